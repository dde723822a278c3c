//! The tables of a scenario and the words in them, as they stand in a file.

use super::table::table;
use crate::names::named;

table! {
    /// A belt, its supports and loads, and how to solve for its shape.
    ///
    /// Units: SI (m, N, rad, kg) or any consistent set.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Scenario {
        /// Name for people, as in titles of figures.
        #[serde(default)]
        pub name: String,
        /// Energy of the bent belt. Default: "shell" where a thickness is known, else "wunderlich".
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub energy: Option<EnergyModel>,
        /// The belt itself, in its flat, unloaded state.
        pub belt: BeltSpec,
        /// What holds the belt, in the order of `at`. Without any, the start is held in the natural pose.
        #[serde(default)]
        pub supports: Vec<SupportSpec>,
        /// Pairs of spine points held at a fixed offset, Eq. (35).
        #[serde(default)]
        #[schemars(length(max = 100))]
        pub links: Vec<LinkSpec>,
        /// Gravity and dead forces.
        #[serde(default)]
        pub loads: LoadsSpec,
        /// How to solve.
        #[serde(default)]
        pub solver: SolverSpec,
    }
}

table! {
    /// The board that the belt is cut from: width, rigidity, and its segments along the spine.
    ///
    /// Its rigidity comes from exactly one of `rigidity`, `material` and `layers`.
    #[derive(Debug, Clone, PartialEq)]
    pub struct BeltSpec {
        /// Width V. Units: m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub width: f64,
        /// Flexural rigidity R_f of the whole width. Units: N·m².
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub rigidity: Option<f64>,
        /// One homogeneous sheet, in place of `rigidity`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub material: Option<MaterialSpec>,
        /// A laminate, in place of `rigidity`: from bottom (−ξ) to top.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(length(min = 1, max = 1000))]
        pub layers: Option<Vec<LayerSpec>>,
        /// Thickness of a belt given by its rigidity, for `energy = "shell"`; a material and layers have their own. Units: m.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub thickness: Option<f64>,
        /// Poisson's ratio ν, used only where `natural_bend` is not 0 and for `energy = "shell"`; that of a material or layers
        /// wins. Default: 0.3.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
        pub poisson: Option<f64>,
        /// Bend ω_ζ of the unloaded belt; positive curls towards −ξ. Units: rad/m.
        #[serde(default)]
        pub natural_bend: f64,
        /// Mass per length, lumped on the spine; a material or layers that give it win. Units: kg/m.
        #[serde(default)]
        #[schemars(extend("minimum" = 0))]
        pub density: f64,
        /// Whether the end joins the start.
        #[serde(default)]
        pub closed: bool,
        /// Signed initial twist of a closed belt, in half turns.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = -20, max = 20))]
        pub half_turns: Option<i32>,
        /// What the belt consists of, in order along the spine.
        #[schemars(length(min = 1))]
        pub segments: Vec<SegmentSpec>,
    }
}

table! {
    /// A homogeneous, isotropic sheet.
    #[derive(Debug, Clone, PartialEq)]
    pub struct MaterialSpec {
        /// Name of a known material; `young`, `poisson` and `density` are its own unless given. Units: SI.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub preset: Option<String>,
        /// Young's modulus E. Units: Pa.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub young: Option<f64>,
        /// Poisson's ratio ν.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
        pub poisson: Option<f64>,
        /// Thickness t. Units: m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub thickness: f64,
        /// Mass per volume. Units: kg/m³.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0))]
        pub density: Option<f64>,
    }
}

table! {
    /// One layer of a laminate.
    #[derive(Debug, Clone, PartialEq)]
    pub struct LayerSpec {
        /// Name of a known material. Units: SI.
        pub material: String,
        /// Thickness. Units: m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub thickness: f64,
    }
}

/// A stretch of the belt, or a bend of the board between two.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "io",
    derive(serde::Serialize, schemars::JsonSchema),
    serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)
)]
pub enum SegmentSpec {
    /// A straight strip.
    Straight {
        /// Length along the spine. Units: m.
        #[cfg_attr(feature = "io", schemars(extend("exclusiveMinimum" = 0)))]
        length: f64,
        /// Bend ω_ζ of the unloaded segment, in place of the belt's. Units: rad/m.
        #[cfg_attr(feature = "io", serde(skip_serializing_if = "Option::is_none"))]
        natural_bend: Option<f64>,
        /// Flexural rigidity, in place of the belt's. Units: N·m².
        #[cfg_attr(feature = "io", serde(skip_serializing_if = "Option::is_none"))]
        rigidity: Option<Rigidity>,
    },
    /// A strip curved in its plane.
    Arc {
        /// Length along the spine. Units: m.
        #[cfg_attr(feature = "io", schemars(extend("exclusiveMinimum" = 0)))]
        length: f64,
        /// In-plane (geodesic) curvature; positive turns η towards ζ. Units: rad/m.
        curvature: f64,
        /// Bend ω_ζ of the unloaded segment, in place of the belt's. Units: rad/m.
        #[cfg_attr(feature = "io", serde(skip_serializing_if = "Option::is_none"))]
        natural_bend: Option<f64>,
        /// Flexural rigidity, in place of the belt's. Units: N·m².
        #[cfg_attr(feature = "io", serde(skip_serializing_if = "Option::is_none"))]
        rigidity: Option<Rigidity>,
    },
    /// A bend of the board at a point.
    Corner {
        /// Angle, at most 120° in magnitude; positive turns η towards ζ. Units: rad.
        #[cfg_attr(feature = "io", schemars(range(min = -2.0943951033, max = 2.0943951033)))]
        angle: f64,
    },
    /// A stiffener.
    Rigid {
        /// Length along the spine. Units: m.
        #[cfg_attr(feature = "io", schemars(extend("exclusiveMinimum" = 0)))]
        length: f64,
    },
}

/// Flexural rigidity of a segment: one number, or a table along it.
#[derive(Debug, Clone, PartialEq)]
pub enum Rigidity {
    /// The same everywhere. Units: N·m².
    Constant(f64),
    /// Piecewise linear along the segment.
    Table(RigidityTable),
}

table! {
    /// Flexural rigidity, piecewise linear along a segment.
    ///
    /// Shapes: `u` and `value` have one length, at least 2.
    #[derive(Debug, Clone, PartialEq)]
    pub struct RigidityTable {
        /// Arc lengths from the start of the segment, rising. Units: m.
        #[schemars(length(min = 2, max = 10_000))]
        pub u: Vec<f64>,
        /// Rigidity at each of them. Units: N·m².
        #[schemars(length(min = 2, max = 10_000))]
        pub value: Vec<f64>,
    }
}

/// A place along the spine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// The start of the belt, u = 0.
    Start,
    /// The end of the belt, u = U.
    End,
    /// An arc length from the start. Units: m.
    ArcLength(f64),
}

/// One component of a support's position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Component {
    /// Held at this coordinate. Units: m.
    Held(f64),
    /// Free to move.
    Free,
}

named! {
    /// A body axis.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub enum Axis {
        /// The normal ξ.
        Xi = "xi",
        /// The tangent η.
        Eta = "eta",
        /// The width direction ζ.
        Zeta = "zeta",
    }
}

table! {
    /// What holds the belt at one point of its spine.
    ///
    /// Its orientation is given by at most one of `rotation`, `euler` and `quaternion`; without any it is free.
    #[derive(Debug, Clone, PartialEq)]
    pub struct SupportSpec {
        /// Where along the spine.
        pub at: Place,
        /// Position of the spine point, world axes; leave out for a free position. Shapes: (3,). Units: m.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub position: Option<[Component; 3]>,
        /// Frame as a rotation vector, `R = exp([rotation]×)`, world axes. Shapes: (3,). Units: rad.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub rotation: Option<[f64; 3]>,
        /// Frame as Eulerian angles [φ, θ, ψ], Eq. (1). Shapes: (3,). Units: rad.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub euler: Option<[f64; 3]>,
        /// Frame as a unit quaternion [w, x, y, z]. Shapes: (4,).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub quaternion: Option<[f64; 4]>,
        /// Body axis about which the held frame is free to turn.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub hinge: Option<Axis>,
        /// Moment on the belt about the axis of the hinge, right-handed; its potential is minus moment times angle.
        /// Units: N·m.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub moment: Option<f64>,
        /// Whether the rib is square to the spine, β = 0. Default: at an end with both position and orientation.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub square_rib: Option<bool>,
    }
}

table! {
    /// Two spine points held at a fixed offset.
    ///
    /// Source: Eq. (35).
    #[derive(Debug, Clone, PartialEq)]
    pub struct LinkSpec {
        /// The point that the offset is counted from.
        pub from: Place,
        /// The point at the offset.
        pub to: Place,
        /// x(to) − x(from), world axes. Shapes: (3,). Units: m.
        pub offset: [f64; 3],
    }
}

table! {
    /// Loads that have a potential.
    #[derive(Debug, Clone, PartialEq, Default)]
    pub struct LoadsSpec {
        /// Acceleration of gravity, world axes. Shapes: (3,). Units: m/s².
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub gravity: Option<[f64; 3]>,
        /// Dead forces at points.
        #[serde(default)]
        #[schemars(length(max = 10_000))]
        pub points: Vec<PointLoad>,
    }
}

table! {
    /// A dead force at one point of the spine, or off it at the end of a lever.
    #[derive(Debug, Clone, PartialEq)]
    pub struct PointLoad {
        /// Where along the spine.
        pub at: Place,
        /// Force, world axes. Shapes: (3,). Units: N.
        pub force: [f64; 3],
        /// From the spine point to where the force acts, body axes. Shapes: (3,). Units: m.
        #[serde(default)]
        pub lever: [f64; 3],
    }
}

named! {
    /// The energy of the bent belt.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub enum EnergyModel {
        /// Developable belt, the source's: R_f/2 · sqrt(1+β²) · κ₁², Eq. (34).
        Fishbone = "fishbone",
        /// Developable belt, the narrow limit of the plate: R_f/2 · κ₁².
        Sadowsky = "sadowsky",
        /// Developable plate of finite width.
        Wunderlich = "wunderlich",
        /// Plate of finite width and thickness, which may stretch.
        Shell = "shell",
    }
}

named! {
    /// The method of solution.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
    pub enum Method {
        /// Bend and rib slope as the only unknowns.
        #[default]
        Intrinsic = "intrinsic",
        /// The source's own: Ritz's method with Eulerian angles, Eq. (37)–(43).
        Ritz = "ritz",
    }
}

table! {
    /// How to solve.
    #[derive(Debug, Clone, PartialEq)]
    #[serde(default)]
    pub struct SolverSpec {
        /// The method of solution.
        pub method: Method,
        /// Largest estimated error that the mesh may make, relative: of the energy, the spine (over U), the reactions and the
        /// tightest bend on the spine. Elements are as short as this needs.
        #[schemars(range(min = 1e-6, max = 0.1))]
        pub accuracy: f64,
        /// Number of elements in all, of equal length, shared out by length, in place of a mesh by `accuracy`.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 4, max = 100_000))]
        pub elements: Option<usize>,
        /// Max-norm of stationarity, constraints and complementarity, with lengths in U and energy in mean R_f/U.
        #[schemars(range(min = 1e-13, max = 1e-2))]
        pub tolerance: f64,
        /// Largest displacement on the belt, in its width V, from which a jump to another equilibrium is reported as a snap.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub snap_size: f64,
        /// Direction of the bulge, world axes: of two mirror images, the one that bulges along it is taken. Shapes: (3,).
        pub bulge: [f64; 3],
        /// Settings of the method `ritz`.
        pub ritz: RitzSpec,
    }
}

impl Default for SolverSpec {
    fn default() -> Self {
        Self {
            method: Method::default(),
            accuracy: 1e-3,
            elements: None,
            tolerance: 1e-8,
            snap_size: 1e-2,
            bulge: [1.0, 0.0, 0.0],
            ritz: RitzSpec::default(),
        }
    }
}

table! {
    /// Settings of the source's own method.
    ///
    /// Source: Eq. (37)–(43).
    #[derive(Debug, Clone, PartialEq)]
    #[serde(default)]
    pub struct RitzSpec {
        /// Number of basis functions of each angle: 1, u, and pairs of a sine and a cosine, Eq. (41)–(43); even.
        #[schemars(range(min = 6, max = 40), extend("multipleOf" = 2))]
        pub basis: usize,
        /// Number of points where Eq. (25) and (32) are collocated.
        #[schemars(range(min = 2, max = 500))]
        pub points: usize,
        /// Penalty on the collocated constraints; the default is that at which the source's printed shapes come out.
        #[schemars(range(min = 1e-6, max = 1e12))]
        pub penalty: f64,
        /// Number of updates of the multipliers; 0 keeps to the penalty alone.
        #[schemars(range(max = 1000))]
        pub updates: usize,
    }
}

impl Default for RitzSpec {
    fn default() -> Self {
        Self {
            basis: 10,
            points: 16,
            penalty: 1e2,
            updates: 1,
        }
    }
}
