//! Spines to test on.

use crate::geometry::{Pose, Twist};
use crate::strip::spine::{Piece, Spine};
use nalgebra::Vector3;
use proptest::prelude::*;

/// A spine with `n` equal elements and fields given as functions of u.
pub(crate) fn spine(
    length: f64,
    width: f64,
    n: usize,
    bend: impl Fn(f64) -> f64,
    slope: impl Fn(f64) -> f64,
) -> Spine {
    let u: Vec<f64> = (0..=n).map(|i| length * i as f64 / n as f64).collect();
    let bend = u.iter().copied().map(bend).collect();
    let slope = u.iter().copied().map(slope).collect();
    let start = Pose::exp(&Twist {
        translation: Vector3::new(0.1, -0.2, 0.3),
        rotation: Vector3::new(0.5, 0.3, -0.8),
    });
    Spine::straight(width, start, u, bend, slope)
}

/// A wave `c0 + c1 cos(k u) + c2 sin(k u)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wave(pub(crate) [f64; 3], pub(crate) f64);

impl Wave {
    pub(crate) fn at(&self, u: f64) -> f64 {
        let (s, c) = (self.1 * u).sin_cos();
        self.0[0] + self.0[1] * c + self.0[2] * s
    }
}

/// Fields of smooth belts of length 1 with |β'| below `steepness`, sloping ribs at the ends.
pub(crate) fn waves(steepness: f64) -> impl Strategy<Value = (Wave, Wave)> {
    let amplitude = -1.0..1.0f64;
    let bend = (
        [amplitude.clone(), amplitude.clone(), amplitude.clone()],
        1.0..6.0f64,
    )
        .prop_map(|(c, k)| Wave(c.map(|x| 4.0 * x), k));
    let slope = (
        [amplitude.clone(), amplitude.clone(), amplitude],
        1.0..6.0f64,
    )
        .prop_map(move |(c, k)| {
            Wave(
                [c[0], steepness * c[1] / k / 1.5, steepness * c[2] / k / 1.5],
                k,
            )
        });
    (bend, slope)
}

/// A part of a board to test on.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Part {
    Straight(f64),
    /// Length and curvature.
    Arc(f64, f64),
    Corner(f64),
    Rigid(f64),
}

/// A board, and ribs to lay on it.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) width: f64,
    pub(crate) parts: Vec<Part>,
    pub(crate) half_turns: Option<i32>,
    /// Half the length over which the ribs turn with the board.
    pub(crate) reach: f64,
    /// Amplitude and number of waves of the rib angle beyond that.
    pub(crate) wave: (f64, f64),
    /// Length of the elements.
    pub(crate) step: f64,
}

/// A stretch of the heading as a function of u.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: f64,
    length: f64,
    heading: f64,
    curvature: f64,
    is_rigid: bool,
}

impl Stretch {
    /// ∫ heading du over the part of it up to u.
    fn integral_to(&self, u: f64) -> f64 {
        let t = (u - self.from).clamp(0.0, self.length);
        self.heading * t + 0.5 * self.curvature * t * t
    }
}

impl Plan {
    pub(crate) fn open(width: f64, parts: &[Part]) -> Self {
        Self {
            width,
            parts: parts.to_vec(),
            half_turns: None,
            reach: 2.0 * width,
            wave: (0.0, 0.0),
            step: width / 8.0,
        }
    }

    /// The spine with ribs whose flat direction is the heading of the board averaged over the reach, and a wave.
    pub(crate) fn spine(&self) -> Spine {
        let (own, end) = self.stretches();
        let length = own.iter().map(|stretch| stretch.length).sum::<f64>();
        let all = self.extended(&own, end, length);
        let mut spine = Spine::straight(
            self.width,
            Pose::identity(),
            vec![0.0],
            vec![0.0],
            vec![0.0],
        );
        let mut parts = own.iter();
        let mut heading = 0.0;
        for (index, part) in self.parts.iter().enumerate() {
            match *part {
                Part::Corner(angle) => {
                    heading += angle;
                    let u = spine.u[spine.u.len() - 1];
                    self.node(&mut spine, &all, heading, u, Piece::Joint { angle });
                    if let Some(Part::Rigid(_)) = self.parts.get(index + 1) {
                        *spine.rib_slope.last_mut().expect("a node") = 0.0;
                    }
                }
                Part::Straight(_) | Part::Arc(..) | Part::Rigid(_) => {
                    let stretch = parts.next().expect("a stretch for every part of length");
                    self.joint(&mut spine, &all, heading, stretch);
                    heading = self.elements(&mut spine, &all, stretch);
                }
            }
        }
        Spine {
            half_turns: self.half_turns,
            ..Spine::from_fields(
                spine.width,
                spine.pose[0],
                spine.pieces,
                spine.u,
                spine.bend,
                spine.rib_slope,
            )
        }
    }

    fn stretches(&self) -> (Vec<Stretch>, f64) {
        let (mut list, mut from, mut heading) = (Vec::new(), 0.0, 0.0);
        for part in &self.parts {
            let (length, curvature) = match *part {
                Part::Straight(length) | Part::Rigid(length) => (length, 0.0),
                Part::Arc(length, curvature) => (length, curvature),
                Part::Corner(angle) => {
                    heading += angle;
                    continue;
                }
            };
            let is_rigid = matches!(part, Part::Rigid(_));
            list.push(Stretch {
                from,
                length,
                heading,
                curvature,
                is_rigid,
            });
            from += length;
            heading += curvature * length;
        }
        (list, heading)
    }

    /// The heading before and after the belt: straight on, or round again.
    fn extended(&self, own: &[Stretch], end: f64, length: f64) -> Vec<Stretch> {
        let hand = if self.half_turns.unwrap_or(0) % 2 == 0 {
            1.0
        } else {
            -1.0
        };
        let straight = |from: f64, heading: f64| Stretch {
            from,
            length: 100.0,
            heading,
            curvature: 0.0,
            is_rigid: false,
        };
        if self.half_turns.is_none() {
            let ends = [straight(-100.0, own[0].heading), straight(length, end)];
            return [&ends[..1], own, &ends[1..]].concat();
        }
        let round = |shift: f64, turn: f64| {
            own.iter().map(move |stretch| Stretch {
                from: stretch.from + shift,
                heading: turn + hand * stretch.heading,
                curvature: hand * stretch.curvature,
                ..*stretch
            })
        };
        round(-length, -hand * end)
            .chain(own.iter().copied())
            .chain(round(length, end))
            .collect()
    }

    /// Angle from the y axis to the normal of the flat rib.
    fn rib_normal(&self, all: &[Stretch], u: f64) -> f64 {
        let integral = |u: f64| {
            all.iter()
                .map(|stretch| stretch.integral_to(u))
                .sum::<f64>()
        };
        let mean = (integral(u + self.reach) - integral(u - self.reach)) / (2.0 * self.reach);
        let gap = |stretch: &Stretch| {
            (stretch.from - u)
                .max(u - stretch.from - stretch.length)
                .max(0.0)
        };
        let to_rigid = all
            .iter()
            .filter(|stretch| stretch.is_rigid)
            .map(gap)
            .fold(self.reach, f64::min);
        mean + to_rigid / self.reach * self.wave.0 * self.wave_at(u)
    }

    /// Repeats after a round, with the other sign after an odd number of half turns.
    fn wave_at(&self, u: f64) -> f64 {
        let waves = match self.half_turns {
            None => self.wave.1,
            Some(half_turns) => self.wave.1.round() + 0.5 * f64::from(half_turns.rem_euclid(2)),
        };
        let length: f64 = self
            .stretches()
            .0
            .iter()
            .map(|stretch| stretch.length)
            .sum();
        (std::f64::consts::TAU * waves * u / length + 0.4).sin()
    }

    fn slope(&self, all: &[Stretch], u: f64, heading: f64, is_rigid: bool) -> f64 {
        if is_rigid {
            0.0
        } else {
            (self.rib_normal(all, u) - heading).tan()
        }
    }

    fn node(&self, spine: &mut Spine, all: &[Stretch], heading: f64, u: f64, piece: Piece) {
        let is_rigid = piece == Piece::Rigid;
        spine.pieces.push(piece);
        spine.u.push(u);
        spine.pose.push(Pose::identity());
        spine.bend.push(if is_rigid {
            0.0
        } else {
            3.0 * self.wave_at(u + 0.1 * self.width)
        });
        spine.rib_slope.push(self.slope(all, u, heading, is_rigid));
    }

    /// A joint before a stretch, where bend and slope may jump; the first node is set instead.
    fn joint(&self, spine: &mut Spine, all: &[Stretch], heading: f64, stretch: &Stretch) {
        if spine.u.len() > 1 {
            self.node(
                spine,
                all,
                heading,
                stretch.from,
                Piece::Joint { angle: 0.0 },
            );
        }
        let last = spine.u.len() - 1;
        spine.rib_slope[last] = self.slope(all, spine.u[last], heading, stretch.is_rigid);
        spine.bend[last] = if stretch.is_rigid {
            0.0
        } else {
            3.0 * self.wave_at(spine.u[last])
        };
    }

    fn elements(&self, spine: &mut Spine, all: &[Stretch], stretch: &Stretch) -> f64 {
        let count = (stretch.length / self.step).ceil().max(1.0);
        let piece = match stretch.is_rigid {
            true => Piece::Rigid,
            false => Piece::Strip {
                geodesic: stretch.curvature,
            },
        };
        for i in 1..=count as usize {
            let along = stretch.length * i as f64 / count;
            let heading = stretch.heading + stretch.curvature * along;
            self.node(spine, all, heading, stretch.from + along, piece);
        }
        stretch.heading + stretch.curvature * stretch.length
    }
}

/// Boards of width 0.1 made of random parts, between straight ends.
pub(crate) fn plans() -> impl Strategy<Value = Plan> {
    let part = prop_oneof![
        (0.05..0.4f64).prop_map(|length| vec![Part::Straight(length)]),
        (0.05..0.4f64, -1.2..1.2f64)
            .prop_map(|(length, turn)| vec![Part::Arc(length, turn / length)]),
        (-1.3..1.3f64).prop_map(|angle| vec![Part::Corner(angle), Part::Straight(0.2)]),
        (0.02..0.1f64).prop_map(|length| vec![
            Part::Straight(0.2),
            Part::Rigid(length),
            Part::Straight(0.2)
        ]),
        (-1.3..1.3f64).prop_map(|angle| {
            let rigid = Part::Rigid(0.2);
            vec![
                Part::Straight(0.2),
                rigid,
                Part::Corner(angle),
                rigid,
                Part::Straight(0.2),
            ]
        }),
    ];
    let parts = prop::collection::vec(part, 1..5).prop_map(|parts| parts.concat());
    (parts, 0.1..0.3f64, 0.0..0.4f64, 0.0..3.0f64).prop_map(|(parts, ends, amplitude, waves)| {
        let ends = [Part::Straight(ends)];
        Plan {
            wave: (amplitude, waves),
            ..Plan::open(0.1, &[&ends[..], &parts, &ends].concat())
        }
    })
}
