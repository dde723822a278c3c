//! One number for every element of a block, with the arithmetic of all lanes at once.
//!
//! Loops over the lanes are written out in every operation: `array::map` is not inlined into code for other targets.

use crate::strip::density::LANES;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// One number for every element of a block.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Wide(pub(super) [f64; LANES]);

impl Wide {
    /// The same number in every lane.
    #[inline(always)]
    pub(super) fn all(x: f64) -> Self {
        Self([x; LANES])
    }

    /// Zero in every lane.
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(super) fn recip(self) -> Self {
        let mut out = self;
        for lane in 0..LANES {
            out.0[lane] = 1.0 / self.0[lane];
        }
        out
    }

    #[inline(always)]
    pub(super) fn square(self) -> Self {
        self * self
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        let mut out = self;
        for lane in 0..LANES {
            out.0[lane] = self.0[lane].sqrt();
        }
        out
    }

    /// The lesser of every lane and a number.
    #[inline(always)]
    pub(super) fn at_most(self, bound: f64) -> Self {
        Self::where_below(self, bound, self, Self::all(bound))
    }

    /// The greater of every lane and a number.
    #[inline(always)]
    pub(super) fn at_least(self, bound: f64) -> Self {
        Self::where_below(self, bound, Self::all(bound), self)
    }

    /// One number in the lanes where x is below a bound, the other elsewhere.
    #[inline(always)]
    pub(super) fn where_below(x: Self, bound: f64, below: Self, above: Self) -> Self {
        let mut out = above;
        for lane in 0..LANES {
            out.0[lane] = if x.0[lane] < bound {
                below.0[lane]
            } else {
                above.0[lane]
            };
        }
        out
    }
}

macro_rules! lanewise {
    ($name:ident, $method:ident, $op:tt) => {
        impl $name for Wide {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut out = self;
                for lane in 0..LANES {
                    out.0[lane] = self.0[lane] $op other.0[lane];
                }
                out
            }
        }

        impl $name<f64> for Wide {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                let mut out = self;
                for lane in 0..LANES {
                    out.0[lane] = self.0[lane] $op other;
                }
                out
            }
        }
    };
}

lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);

impl Neg for Wide {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::ZERO - self
    }
}

impl AddAssign for Wide {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        for lane in 0..LANES {
            self.0[lane] += other.0[lane];
        }
    }
}

impl SubAssign for Wide {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        for lane in 0..LANES {
            self.0[lane] -= other.0[lane];
        }
    }
}
