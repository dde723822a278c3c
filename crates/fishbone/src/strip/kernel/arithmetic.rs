//! Arithmetic of vectors of three and of matrices of four, written out for the vectoriser.

use super::{Lanes, Triple, Upper};

/// An entry of a symmetric matrix.
#[inline(always)]
pub(in crate::strip) fn entry<T: Copy>(matrix: &[T; 10], i: usize, j: usize) -> T {
    /// Index in the upper triangle of entry (i, j), a number.
    const AT: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];
    matrix[AT[i][j]]
}

/// An array by index, written out: `array::map` is not inlined into code for other targets.
#[inline(always)]
pub(in crate::strip) fn three<T>(at: impl Fn(usize) -> T) -> [T; 3] {
    [at(0), at(1), at(2)]
}

/// The upper triangle of a 4×4 matrix by rows.
#[inline(always)]
pub(in crate::strip) fn upper(at: impl Fn(usize, usize) -> f64) -> Upper {
    let (a, b) = (four(|j| at(0, j)), three(|j| at(1, 1 + j)));
    let [c, d] = [at(2, 2), at(2, 3)];
    [a[0], a[1], a[2], a[3], b[0], b[1], b[2], c, d, at(3, 3)]
}

#[inline(always)]
pub(in crate::strip) fn four<T>(at: impl Fn(usize) -> T) -> [T; 4] {
    [at(0), at(1), at(2), at(3)]
}

#[inline(always)]
pub(in crate::strip) fn triple(lanes: &[Lanes], from: usize, lane: usize) -> Triple {
    [
        lanes[from][lane],
        lanes[from + 1][lane],
        lanes[from + 2][lane],
    ]
}

#[inline(always)]
pub(in crate::strip) fn dot(a: Triple, b: Triple) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(in crate::strip) fn cross(a: Triple, b: Triple) -> Triple {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
pub(in crate::strip) fn plus(a: Triple, b: Triple) -> Triple {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(in crate::strip) fn minus(a: Triple, b: Triple) -> Triple {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A vector of the world, in the axes of a frame.
#[inline(always)]
pub(in crate::strip) fn seen_from(frame: &[Triple; 3], a: Triple) -> Triple {
    [dot(frame[0], a), dot(frame[1], a), dot(frame[2], a)]
}

/// A vector in the axes of a frame, in the axes of the world: the inverse of [`seen_from`].
#[inline(always)]
pub(in crate::strip) fn in_world(frame: &[Triple; 3], a: Triple) -> Triple {
    three(|i| frame[0][i] * a[0] + frame[1][i] * a[1] + frame[2][i] * a[2])
}
