//! The mesh of a problem: how its belt is divided into elements.

use super::Problem;
use crate::problem::belt::Division;
use crate::problem::program::{BeltProgram, Piece};
use crate::strip::bounds::ActiveEdges;

/// A mesh, with the active edges of its pieces.
#[derive(Debug, Clone)]
pub(crate) struct Mesh {
    /// The elements of every stretch of the belt.
    divisions: Vec<Division>,
    /// Whether each piece is a strip, and its active edges; empty before these are chosen.
    pieces: Vec<(bool, ActiveEdges)>,
}

impl Mesh {
    /// About `count` elements, as equal in length as the stretches of the belt allow.
    pub(crate) fn uniform(problem: &Problem, count: usize) -> Self {
        Self {
            divisions: problem.divided(count),
            pieces: Vec::new(),
        }
    }

    /// The mesh of a programme of a problem.
    pub(crate) fn of(problem: &Problem, program: &BeltProgram) -> Self {
        let pieces = program.pieces.iter().map(is_strip);
        Self {
            divisions: problem.division_of(program),
            pieces: pieces.zip(program.edges.iter().copied()).collect(),
        }
    }

    /// Every element split into two of equal length, with its active edges.
    pub(crate) fn halved(&self) -> Self {
        let split = |share: &f64| [0.5 * share; 2];
        let halved = |division: &Division| Division(division.0.iter().flat_map(split).collect());
        let twice = |piece: &(bool, ActiveEdges)| vec![*piece; if piece.0 { 2 } else { 1 }];
        Self {
            divisions: self.divisions.iter().map(halved).collect(),
            pieces: self.pieces.iter().flat_map(twice).collect(),
        }
    }

    /// The mesh whose elements have about the given lengths where the elements of this one are, in U; no element is much
    /// longer than its neighbours.
    ///
    /// Shapes: `lengths` one an element.
    pub(crate) fn graded(&self, problem: &Problem, lengths: &[f64]) -> Self {
        let wholes = problem.lengths_of_stretches();
        let own = self.divisions.iter().zip(&wholes);
        let own: Vec<f64> = own
            .flat_map(|(division, whole)| division.0.iter().map(move |share| share * whole))
            .collect();
        let smooth = smoothed(&own, lengths);
        let mut from = 0;
        let graded = self.divisions.iter().zip(&wholes).map(|(division, whole)| {
            let of_stretch = from..from + division.0.len();
            from = of_stretch.end;
            redivided(division, *whole, &smooth[of_stretch])
        });
        Self {
            divisions: graded.collect(),
            pieces: Vec::new(),
        }
    }

    /// Number of elements.
    pub(crate) fn elements(&self) -> usize {
        self.divisions.iter().map(|division| division.0.len()).sum()
    }
}

/// Lengths at most as long as given that grow by no more than a share of the way along the belt.
fn smoothed(own: &[f64], lengths: &[f64]) -> Vec<f64> {
    /// Growth of the length of elements along the belt, dimensionless.
    const GROWTH: f64 = 0.3;
    let mut smooth = lengths.to_vec();
    let mut limit = |k: usize, beside: usize| {
        let way = 0.5 * (own[k] + own[beside]);
        smooth[k] = smooth[k].min(smooth[beside] + GROWTH * way);
    };
    (1..own.len()).for_each(|k| limit(k, k - 1));
    (1..own.len()).rev().for_each(|k| limit(k - 1, k));
    smooth
}

/// A stretch divided anew, into elements of about the given lengths where its elements are.
fn redivided(division: &Division, whole: f64, lengths: &[f64]) -> Division {
    if division.0.is_empty() {
        return division.clone();
    }
    /// Rounding error of a number of elements.
    const ROUNDING: f64 = 1e-9;
    let counts = division.0.iter().zip(lengths);
    let counts: Vec<f64> = counts
        .map(|(share, length)| share * whole / length)
        .collect();
    let due: f64 = counts.iter().sum();
    let elements = ((due - ROUNDING).ceil() as usize).max(1);
    let mut places = Vec::with_capacity(elements + 1);
    let (mut start, mut done) = (0.0, 0.0);
    for (share, count) in division.0.iter().zip(&counts) {
        while places.len() < elements {
            let next = places.len() as f64 * due / elements as f64;
            if next > done + count {
                break;
            }
            places.push(start + share * ((next - done) / count));
        }
        start += share;
        done += count;
    }
    places.push(start);
    Division(places.windows(2).map(|ends| ends[1] - ends[0]).collect())
}

impl Problem {
    /// The programme on a mesh; `None` where the belt has other stretches than the mesh.
    pub(crate) fn program_on(&self, mesh: &Mesh) -> Option<BeltProgram> {
        let mut program = self.program_divided(&mesh.divisions)?;
        if mesh.pieces.is_empty() {
            return Some(program);
        }
        let pieces = program.pieces.iter().map(is_strip);
        if !pieces.eq(mesh.pieces.iter().map(|(is_strip, _)| *is_strip)) {
            return None;
        }
        program.edges = mesh.pieces.iter().map(|(_, edges)| *edges).collect();
        Some(program)
    }
}

fn is_strip(piece: &Piece) -> bool {
    matches!(piece, Piece::Strip(_))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{BeltSpec, Scenario, SegmentSpec};

    fn problem() -> Problem {
        let segments = vec![
            SegmentSpec::straight(1.0),
            SegmentSpec::Rigid { length: 0.5 },
            SegmentSpec::straight(2.5),
        ];
        Problem::new(Scenario::new(BeltSpec::new(0.1, 1.0, segments))).unwrap()
    }

    fn lengths(problem: &Problem, mesh: &Mesh) -> Vec<f64> {
        let program = problem.program_on(mesh).unwrap();
        program
            .elements()
            .map(|(_, element)| element.length)
            .collect()
    }

    #[test]
    fn test_mesh_of_a_programme_makes_the_same_programme() {
        let problem = problem();
        let program = problem.program(20);
        let again = problem.program_on(&Mesh::of(&problem, &program)).unwrap();
        for (one, other) in program.pieces.iter().zip(&again.pieces) {
            assert!((one.length() - other.length()).abs() < 1e-15);
        }
        assert_eq!(program.pieces.len(), again.pieces.len());
    }

    #[test]
    fn test_halved_mesh_has_two_elements_for_each() {
        let problem = problem();
        let mesh = Mesh::uniform(&problem, 20);
        let (own, halves) = (lengths(&problem, &mesh), lengths(&problem, &mesh.halved()));
        assert_eq!(halves.len(), 2 * own.len());
        for (whole, halves) in own.iter().zip(halves.chunks(2)) {
            assert!(halves.iter().all(|half| (half - 0.5 * whole).abs() < 1e-15));
        }
    }

    #[test]
    fn test_graded_mesh_is_short_where_asked_grows_slowly_and_fills_the_belt() {
        let problem = problem();
        let mesh = Mesh::uniform(&problem, 40);
        let mut asked = lengths(&problem, &mesh);
        asked[20] = 0.001;
        let graded = lengths(&problem, &mesh.graded(&problem, &asked));
        let total: f64 = graded.iter().sum();
        assert!((total - 3.5 / 4.0).abs() < 1e-12);
        let shortest = graded.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((0.0009..=0.001).contains(&shortest), "{shortest}");
        assert!(graded.iter().all(|length| *length <= 0.025 + 1e-12));
        assert!(graded.len() > 60);
    }

    #[test]
    fn test_mesh_of_another_belt_is_refused() {
        let mesh = Mesh::uniform(&problem(), 20);
        let whole = Scenario::new(BeltSpec::new(0.1, 1.0, vec![SegmentSpec::straight(4.0)]));
        assert!(Problem::new(whole).unwrap().program_on(&mesh).is_none());
    }
}
