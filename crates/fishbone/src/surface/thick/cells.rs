//! The curvature along curved ribs, as means over cells of the board.
//!
//! A rib's curvature is known at every point of it; a point of the board is met by the rib that passes it. On every line along
//! the board the ribs' values are joined by straight lines, and their mean over each cell is taken. Where ribs gather at an
//! edge, beside inflections, the curvature of the model has peaks on next to no material that change with the mesh: means see
//! as little of them as the board does.

use super::rows::{ROWS, Rows};
use super::tensor::BoardTensor;
use crate::strip::shell::Rib;
use crate::strip::spine::{Piece, Spine};

/// Cells in a length of one width, a number: finer ones show the mesh, coarser ones cut the peaks of the board.
const CELLS_IN_WIDTH: f64 = 24.0;
/// Ribs in an element at least, a number.
const RIBS: f64 = 3.0;
/// Share of a cell that ribs must reach for it to be bent: far above rounding, far below what counts.
const REACHED: f64 = 1e-9;

/// Cells of equal length along a stretch of the board, from a clamp, a corner or an end to the next.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cells {
    /// Arc length at which the stretch starts.
    pub(super) start: f64,
    /// Arc length at which it ends.
    pub(super) end: f64,
    /// Length of a cell.
    pub(super) length: f64,
    /// Element that holds the middle of each cell.
    pub(super) elements: Vec<usize>,
}

impl Cells {
    /// The cells of a run of elements.
    fn of(spine: &Spine, run: &[usize]) -> Self {
        let (start, end) = (spine.u[run[0]], spine.u[run[run.len() - 1] + 1]);
        let count = (CELLS_IN_WIDTH * (end - start) / spine.width)
            .round()
            .max(2.0);
        let length = (end - start) / count;
        let mut at = 0;
        let element = |cell: usize| {
            let middle = start + (cell as f64 + 0.5) * length;
            while at + 1 < run.len() && spine.u[run[at] + 1] < middle {
                at += 1;
            }
            run[at]
        };
        let elements = (0..count as usize).map(element).collect();
        Self {
            start,
            end,
            length,
            elements,
        }
    }

    /// Number of cells.
    pub(super) fn count(&self) -> usize {
        self.elements.len()
    }

    /// Whether an arc length lies on the stretch.
    pub(super) fn holds(&self, u: f64) -> bool {
        (self.start..=self.end).contains(&u)
    }

    /// Arc length at the middle of a cell.
    pub(super) fn middle(&self, cell: usize) -> f64 {
        self.start + (cell as f64 + 0.5) * self.length
    }

    /// The cell whose middle lies before an arc length, and the share of the way from there to the next; held at the ends.
    pub(super) fn around(&self, u: f64) -> (usize, f64) {
        let place = ((u - self.start) / self.length - 0.5).clamp(0.0, self.count() as f64 - 1.0);
        let before = (place.floor() as usize).min(self.count() - 2);
        (before, place - before as f64)
    }
}

/// Tensors at every cell and row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    cells: usize,
    /// Row by row.
    values: Vec<BoardTensor>,
}

impl Field {
    /// The field of a function of cell and row.
    pub(super) fn from_fn(cells: usize, value: impl Fn(usize, usize) -> BoardTensor) -> Self {
        let rows = (0..ROWS).flat_map(|row| (0..cells).map(move |cell| (cell, row)));
        Self {
            cells,
            values: rows.map(|(cell, row)| value(cell, row)).collect(),
        }
    }

    pub(super) fn at(&self, cell: usize, row: usize) -> BoardTensor {
        self.values[row * self.cells + cell]
    }

    pub(super) fn at_mut(&mut self, cell: usize, row: usize) -> &mut BoardTensor {
        &mut self.values[row * self.cells + cell]
    }
}

/// The stretches of a board with the curvature along their ribs; none where ribs are straight.
pub(super) fn stretches(spine: &Spine, rows: &Rows) -> Vec<(Cells, Field)> {
    let runs = runs(spine);
    let half_width = 0.5 * spine.width;
    let stretch = |index: usize| {
        let cells = Cells::of(spine, &runs[index]);
        let feet = with_seam(spine, &runs, index)?;
        let lines = rows.t.iter().map(|t| {
            let line: Vec<_> = feet.iter().map(|foot| foot.at(half_width * t)).collect();
            means(&line, &cells)
        });
        let field = Field {
            cells: cells.count(),
            values: lines.flatten().collect(),
        };
        Some((cells, field))
    };
    (0..runs.len()).filter_map(stretch).collect()
}

/// The flexible elements between stiffeners and corners.
fn runs(spine: &Spine) -> Vec<Vec<usize>> {
    let mut runs = vec![Vec::new()];
    for (element, piece) in spine.pieces.iter().enumerate() {
        match piece {
            Piece::Strip { .. } if spine.element_length(element) > 0.0 => {
                runs.last_mut().expect("there is a run").push(element);
            }
            Piece::Rigid => runs.push(Vec::new()),
            Piece::Joint { angle } if *angle != 0.0 => runs.push(Vec::new()),
            Piece::Strip { .. } | Piece::Joint { .. } => {}
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}

/// A rib with its place.
#[derive(Clone, Copy)]
struct Foot {
    u: f64,
    geodesic: f64,
    half_width: f64,
    rib: Rib<f64>,
    /// Whether the other face and the other edge are meant, as beyond the seam of a belt of odd half turns.
    is_turned: bool,
}

/// The ribs of a run, and those that reach it from beyond the seam of a closed belt; `None` where ribs are straight.
fn with_seam(spine: &Spine, runs: &[Vec<usize>], index: usize) -> Option<Vec<Foot>> {
    let mut feet = feet(spine, &runs[index])?;
    let Some(half_turns) = spine.half_turns.filter(|_| is_smooth_at_seam(spine)) else {
        return Some(feet);
    };
    let beyond = |run: &[usize], round: f64| {
        let moved = self::feet(spine, run)?.into_iter().map(move |foot| Foot {
            u: foot.u + round * spine.length(),
            is_turned: half_turns % 2 != 0,
            ..foot
        });
        Some(moved.collect::<Vec<_>>())
    };
    let last = runs.len() - 1;
    if index == last {
        feet.extend(beyond(&runs[0], 1.0)?);
    }
    if index == 0 {
        feet.splice(0..0, beyond(&runs[last], -1.0)?);
    }
    Some(feet)
}

/// Whether the pieces at both ends of a belt are flexible.
fn is_smooth_at_seam(spine: &Spine) -> bool {
    let is_strip = |piece: Option<&Piece>| matches!(piece, Some(Piece::Strip { .. }));
    is_strip(spine.pieces.first()) && is_strip(spine.pieces.last())
}

/// Ribs along a run of elements, both ends among them; `None` where ribs are straight.
fn feet(spine: &Spine, run: &[usize]) -> Option<Vec<Foot>> {
    let foot = |element: usize, share: f64| {
        let distance = share * spine.element_length(element);
        Some(Foot {
            u: spine.u[element] + distance,
            geodesic: spine.pieces[element].geodesic(),
            half_width: 0.5 * spine.width,
            rib: spine.rib(element, distance)?,
            is_turned: false,
        })
    };
    let count = |element: usize| {
        let cells = CELLS_IN_WIDTH * spine.element_length(element) / spine.width;
        cells.round().max(RIBS) as usize
    };
    let inside = run.iter().flat_map(|&element| {
        let n = count(element);
        (0..n).map(move |i| (element, (i as f64 + 0.5) / n as f64))
    });
    let first = (run[0], 0.0);
    let last = (run[run.len() - 1], 1.0);
    let places = [first].into_iter().chain(inside).chain([last]);
    places
        .map(|(element, share)| foot(element, share))
        .collect()
}

impl Foot {
    /// The point of the rib at a distance v from the spine: its arc length, and the curvature in the board's axes there.
    ///
    /// On an arc, v is measured along its radius, and the axes are those of the radius. A rib that runs on beyond the end of
    /// an arc is placed as if the arc went on. Beyond V/2, towards the inner edge of an arc, a slanted rib keeps the curvature
    /// that it has there: the energy is taken no farther.
    fn at(&self, v: f64) -> (f64, BoardTensor) {
        if !self.is_turned {
            return self.on_own_side(v);
        }
        let (u, b) = self.on_own_side(-v);
        let turned = BoardTensor {
            uu: -b.uu,
            uv: b.uv,
            vv: -b.vv,
        };
        (u, turned)
    }

    fn on_own_side(&self, v: f64) -> (f64, BoardTensor) {
        let (slope, geodesic) = (self.rib.slope, self.geodesic);
        let along = self.along(v);
        let within = along.clamp(-self.half_width, self.half_width);
        let tensor = BoardTensor::on_rib(&self.rib.curvature(geodesic, within), slope);
        if geodesic == 0.0 {
            return (self.u - slope * along, tensor);
        }
        let turn = (-geodesic * slope * along).atan2(1.0 - geodesic * along);
        (self.u + turn / geodesic, tensor.turned(turn))
    }

    /// Coordinate along the rib where it meets the line at a distance v from the spine; its nearest approach, if it never does.
    fn along(&self, v: f64) -> f64 {
        let (slope, geodesic) = (self.rib.slope, self.geodesic);
        let reach = v * (2.0 - geodesic * v);
        let square = 1.0 - geodesic * (1.0 + slope * slope) * reach;
        reach / (1.0 + square.max(0.0).sqrt())
    }
}

/// Means over the cells of values joined by straight lines; 0 where there are none.
fn means(line: &[(f64, BoardTensor)], cells: &Cells) -> Vec<BoardTensor> {
    let mut sums = vec![(BoardTensor::default(), 0.0); cells.count()];
    let place = |u: f64| ((u - cells.start) / cells.length).clamp(0.0, cells.count() as f64);
    let mut reached = f64::NEG_INFINITY;
    for pair in line.windows(2) {
        let [(from, first), (to, second)] = [pair[0], pair[1]].map(|(u, b)| (place(u), b));
        reached = from.max(reached);
        let mut cell = reached.floor() as usize;
        while reached < to {
            let until = to.min(cell as f64 + 1.0);
            let share = (0.5 * (reached + until) - from) / (to - from);
            let (sum, length) = &mut sums[cell];
            *sum = *sum + first.towards(second, share) * (until - reached);
            *length += until - reached;
            (reached, cell) = (until, cell + 1);
        }
    }
    let mean = |(sum, length): (BoardTensor, f64)| match length > REACHED {
        true => sum * length.recip(),
        false => BoardTensor::default(),
    };
    sums.into_iter().map(mean).collect()
}
