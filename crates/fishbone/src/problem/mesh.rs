//! The mesh of a problem: how its belt is divided into elements.

use super::Problem;
use crate::problem::belt::Division;
use crate::problem::program::{BeltProgram, Piece};
use crate::strip::bounds::ActiveEdges;
use crate::strip::density::Density;

/// Distance up to which two places are one, in U.
const SAME_PLACE: f64 = 1e-9;

/// A mesh, with the active edges of its pieces.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
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
    pub(crate) fn of<D: Density<F>, const F: usize, const N: usize>(
        problem: &Problem,
        program: &BeltProgram<D, F, N>,
    ) -> Self {
        let pieces = program.pieces.iter().map(is_strip);
        Self {
            divisions: problem.division_of(&program.pieces),
            pieces: pieces.zip(program.edges.iter().copied()).collect(),
        }
    }

    /// Every element split into two of equal length, with its active edges.
    pub(crate) fn halved(&self) -> Self {
        self.split(&vec![2; self.elements()])
    }

    /// Every element split into parts of equal length, with its active edges.
    ///
    /// Shapes: `parts` one number an element
    pub(crate) fn split(&self, parts: &[usize]) -> Self {
        let mut counts = parts.iter().copied();
        let divisions = self.divisions.iter().map(|division| {
            let shares = division.0.iter().zip(counts.by_ref());
            let split = |(share, parts): (&f64, usize)| vec![share / parts as f64; parts];
            Division(shares.flat_map(split).collect())
        });
        let divisions = divisions.collect();
        let mut counts = parts.iter().copied();
        let mut times = |piece: &(bool, ActiveEdges)| match piece.0 {
            true => vec![*piece; counts.next().unwrap_or(1)],
            false => vec![*piece],
        };
        Self {
            divisions,
            pieces: self.pieces.iter().flat_map(&mut times).collect(),
        }
    }

    /// The mesh whose elements have about the given lengths where the elements of this one are, and shorter ones about given
    /// places: lengths grow slowly along the belt, within an element of this mesh, too.
    ///
    /// Shapes: `lengths` one an element, `places` any number of arc lengths, each with the length of elements there.
    ///
    /// Units: U
    pub(crate) fn graded(&self, problem: &Problem, lengths: &[f64], places: &[[f64; 2]]) -> Self {
        let wholes = problem.lengths_of_stretches();
        let mut ramps = ramps(&self.ends(problem), lengths, places).into_iter();
        let graded = self.divisions.iter().zip(&wholes).map(|(division, whole)| {
            let of_stretch: Vec<_> = ramps.by_ref().take(division.0.len()).flatten().collect();
            divided(&of_stretch, *whole)
        });
        Self {
            divisions: graded.collect(),
            pieces: Vec::new(),
        }
    }

    /// The mesh on the stretches that another problem of the same belt has, given with its own problem: at every new end of a
    /// stretch, the nearer node of the element there moves to it. Active edges are left to be chosen.
    pub(crate) fn with_stretches_of(&self, other: &Problem, own: &Problem) -> Self {
        let wholes = other.lengths_of_stretches();
        let cuts: Vec<f64> = wholes
            .iter()
            .scan(0.0, |end, whole| {
                *end += whole;
                Some(*end)
            })
            .collect();
        let is_cut = |at: f64| cuts.iter().any(|cut| (cut - at).abs() <= SAME_PLACE);
        let mut elements = self.ends(own);
        for cut in &cuts {
            let inside = |[from, to]: &[f64; 2]| (from + SAME_PLACE..to - SAME_PLACE).contains(cut);
            let Some(k) = elements.iter().position(inside) else {
                continue;
            };
            let [from, to] = elements[k];
            let is_free = |end: f64| !is_cut(end) && end > 0.0;
            if is_free(to) && (to - cut <= cut - from || !is_free(from)) {
                (elements[k][1], elements[k + 1][0]) = (*cut, *cut);
            } else if is_free(from) {
                (elements[k - 1][1], elements[k][0]) = (*cut, *cut);
            } else {
                elements.splice(k..=k, [[from, *cut], [*cut, to]]);
            }
        }
        let stretches = wholes.iter().zip(&cuts).map(|(whole, end)| {
            let is_inside =
                |[from, to]: &&[f64; 2]| (end - whole..*end).contains(&(0.5 * (from + to)));
            let inside = elements.iter().filter(is_inside);
            Division(inside.map(|[from, to]| (to - from) / whole).collect())
        });
        Self {
            divisions: stretches.collect(),
            pieces: Vec::new(),
        }
    }

    /// Both ends of every element, in U.
    fn ends(&self, problem: &Problem) -> Vec<[f64; 2]> {
        let mut start = 0.0;
        let stretches = self.divisions.iter().zip(problem.lengths_of_stretches());
        let ends = stretches.flat_map(|(division, whole)| {
            let at = start;
            start += whole;
            let place = move |share: f64| at + share * whole;
            division
                .places()
                .map(move |[from, share]| [from, from + share].map(place))
        });
        ends.collect()
    }

    /// Number of elements.
    pub(crate) fn elements(&self) -> usize {
        self.divisions.iter().map(|division| division.0.len()).sum()
    }
}

/// A part of the belt along which the length of elements grows evenly, or not at all.
#[derive(Debug, Clone, Copy)]
struct Ramp {
    /// Length of the part.
    length: f64,
    /// Length of elements at its start.
    from: f64,
    /// Growth of the length of elements along it, dimensionless.
    growth: f64,
}

impl Ramp {
    /// Number of elements on it, ∫ du / (a + g u).
    fn count(&self) -> f64 {
        match self.growth == 0.0 {
            true => self.length / self.from,
            false => (self.growth * self.length / self.from).ln_1p() / self.growth,
        }
    }

    /// The place at which as many elements end, from its start.
    fn place(&self, count: f64) -> f64 {
        match self.growth == 0.0 {
            true => count * self.from,
            false => self.from * (self.growth * count).exp_m1() / self.growth,
        }
    }
}

/// Lengths of elements at most as long as given in each element and at places, that grow by no more than a share of the way
/// along the belt: up from the start of an element, even, and down to its end.
fn ramps(own: &[[f64; 2]], lengths: &[f64], places: &[[f64; 2]]) -> Vec<[Ramp; 3]> {
    /// Growth of the length of elements along the belt, dimensionless.
    const GROWTH: f64 = 0.3;
    let about = |at: f64, length: f64| {
        let by_places = places.iter();
        let by_places = by_places.map(|[place, there]| there + GROWTH * (place - at).abs());
        [at, by_places.fold(length, f64::min)]
    };
    let ends = own.iter().zip(lengths);
    let mut ends: Vec<[f64; 2]> = ends
        .flat_map(|(ends, length)| ends.map(|at| about(at, *length)))
        .collect();
    let mut limit = |k: usize, beside: usize| {
        let way = (ends[k][0] - ends[beside][0]).abs();
        ends[k][1] = ends[k][1].min(ends[beside][1] + GROWTH * way);
    };
    (1..2 * own.len()).for_each(|k| limit(k, k - 1));
    (1..2 * own.len()).rev().for_each(|k| limit(k - 1, k));
    let pairs = ends.chunks(2).zip(lengths);
    pairs
        .map(|(pair, most)| {
            let ([start, first], [end, last]) = (pair[0], pair[1]);
            let whole = end - start;
            let top = (0.5 * (first + last + GROWTH * whole)).min(*most);
            let up = ((top - first) / GROWTH).clamp(0.0, whole);
            let down = ((top - last) / GROWTH).clamp(0.0, whole - up);
            [
                (up, first, GROWTH),
                (whole - up - down, top, 0.0),
                (down, top, -GROWTH),
            ]
            .map(|(length, from, growth)| Ramp {
                length,
                from,
                growth,
            })
        })
        .collect()
}

/// A stretch divided into elements of about the lengths that ramps say; a stiffened stretch has none.
fn divided(ramps: &[Ramp], whole: f64) -> Division {
    /// Rounding error of a number of elements.
    const ROUNDING: f64 = 1e-9;
    let due: f64 = ramps.iter().map(Ramp::count).sum();
    if ramps.is_empty() {
        return Division(Vec::new());
    }
    let elements = ((due - ROUNDING).ceil() as usize).max(1);
    let mut places = Vec::with_capacity(elements + 1);
    let (mut start, mut done) = (0.0, 0.0);
    for ramp in ramps {
        let count = ramp.count();
        while places.len() < elements {
            let next = places.len() as f64 * due / elements as f64;
            if next > done + count {
                break;
            }
            places.push(start + ramp.place(next - done));
        }
        start += ramp.length;
        done += count;
    }
    places.push(whole);
    Division(
        places
            .windows(2)
            .map(|ends| (ends[1] - ends[0]) / whole)
            .collect(),
    )
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
    use crate::scenario::{BeltSpec, Component, Place, Scenario, SegmentSpec, SupportSpec};

    fn problem() -> Problem {
        let segments = vec![
            SegmentSpec::straight(1.0),
            SegmentSpec::Rigid { length: 0.5 },
            SegmentSpec::straight(2.5),
        ];
        Problem::new(Scenario::new(BeltSpec::new(0.1, 1.0, segments))).unwrap()
    }

    #[test]
    fn test_nodes_move_to_the_new_ends_of_stretches() {
        let own = problem();
        let mut scenario = own.scenario().clone();
        scenario.supports = [0.26, 1.2, 1.5 + 0.6].map(held_at).into();
        let other = Problem::new(scenario).unwrap();
        let mesh = Mesh::uniform(&own, 14);
        let moved = mesh.with_stretches_of(&other, &own);
        assert_eq!(moved.elements(), mesh.elements());
        let (before, after) = (lengths(&own, &mesh), lengths(&other, &moved));
        let nodes = |lengths: &[f64]| -> Vec<f64> {
            let ends = lengths.iter().scan(0.0, |end, length| {
                *end += length;
                Some(*end)
            });
            ends.collect()
        };
        for (before, after) in nodes(&before).into_iter().zip(nodes(&after)) {
            let is_cut = [0.26, 1.6]
                .iter()
                .any(|cut| (4.0 * after - cut).abs() < 1e-12);
            assert!(is_cut || (before - after).abs() < 1e-12, "{before} {after}");
        }
        let single = Mesh::uniform(&own, 2).with_stretches_of(&other, &own);
        assert_eq!(single.elements(), 4);
        assert_eq!(
            mesh.with_stretches_of(&own, &own).divisions.len(),
            mesh.divisions.len()
        );
    }

    fn held_at(u: f64) -> SupportSpec {
        let mut support = SupportSpec::new(Place::ArcLength(u));
        support.position = Some([
            Component::Held(0.0),
            Component::Held(u),
            Component::Held(0.0),
        ]);
        support
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
        let graded = lengths(&problem, &mesh.graded(&problem, &asked, &[]));
        let total: f64 = graded.iter().sum();
        assert!((total - 3.5 / 4.0).abs() < 1e-12);
        let shortest = graded.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((0.0009..=0.001).contains(&shortest), "{shortest}");
        assert!(graded.iter().all(|length| *length <= 0.025 + 1e-12));
        assert!(graded.len() > 60);
    }

    #[test]
    fn test_graded_mesh_is_short_about_a_place_within_an_element() {
        let problem = problem();
        let mesh = Mesh::uniform(&problem, 40);
        let asked = lengths(&problem, &mesh);
        let graded = lengths(&problem, &mesh.graded(&problem, &asked, &[[0.0, 1e-5]]));
        assert!((0.9e-5..1.2e-5).contains(&graded[0]), "{}", graded[0]);
        let total: f64 = graded.iter().sum();
        assert!((total - 3.5 / 4.0).abs() < 1e-12);
        // From 1e-5 to 1/40, each longer by less than a half than the one before: ln(2500)/0.3 elements.
        assert!(
            graded
                .windows(2)
                .take(25)
                .all(|pair| pair[1] < 1.5 * pair[0])
        );
        assert!((55..70).contains(&graded.len()), "{}", graded.len());
    }

    #[test]
    fn test_ramps_count_as_many_elements_as_they_place() {
        for growth in [-0.3, 0.0, 0.3] {
            let ramp = Ramp {
                length: 0.4,
                from: 0.2,
                growth,
            };
            let steps = 100_000;
            let sum: f64 = (0..steps)
                .map(|i| (f64::from(i) + 0.5) / f64::from(steps) * ramp.length)
                .map(|u| ramp.length / f64::from(steps) / (ramp.from + growth * u))
                .sum();
            assert!((ramp.count() - sum).abs() < 1e-8);
            assert!((ramp.place(ramp.count()) - ramp.length).abs() < 1e-14);
        }
    }

    #[test]
    fn test_mesh_of_another_belt_is_refused() {
        let mesh = Mesh::uniform(&problem(), 20);
        let whole = Scenario::new(BeltSpec::new(0.1, 1.0, vec![SegmentSpec::straight(4.0)]));
        assert!(Problem::new(whole).unwrap().program_on(&mesh).is_none());
    }
}
