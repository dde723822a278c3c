//! The scenario schema: the belt problem as it stands in a TOML or JSON file. The room `io` reads and writes scenarios.
//!
//! Any consistent set of units serves; the comments assume SI. Angles are in radians.

pub mod error;
mod schema;
mod table;
mod validate;

use crate::board::material::{Laminate, Layer, Material};
use crate::geometry::{Euler, exp, frame_from_euler};
use crate::strip::developable::DevelopableEnergy;
pub use schema::{
    Axis, BeltSpec, Component, EnergyModel, LayerSpec, LinkSpec, LoadsSpec, MaterialSpec, Method,
    Place, PointLoad, Rigidity, RigidityTable, RitzSpec, Scenario, SegmentSpec, SolverSpec,
    SupportSpec,
};

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Distance along the spine below which two places are one, as a share of the belt's length: sums of decimal lengths are not
/// exact.
pub(crate) const SAME_PLACE: f64 = 1e-9;

/// Poisson's ratio of a belt that gives none, dimensionless.
pub(crate) const DEFAULT_POISSON: f64 = 0.3;

impl Scenario {
    /// The scenario of a belt alone: a file with the one table `belt`.
    pub fn new(belt: BeltSpec) -> Self {
        Self {
            name: String::new(),
            energy: None,
            belt,
            supports: Vec::new(),
            links: Vec::new(),
            loads: LoadsSpec::default(),
            solver: SolverSpec::default(),
        }
    }

    /// The energy of the bent belt: as named, else that of the most that is known of the belt.
    ///
    /// The source's own method knows no thickness.
    pub fn energy_model(&self) -> EnergyModel {
        let knows_thickness =
            self.solver.method == Method::Intrinsic && self.belt.stretching().is_some();
        let default = if knows_thickness {
            EnergyModel::Shell
        } else {
            EnergyModel::Wunderlich
        };
        self.energy.unwrap_or(default)
    }

    /// Number of elements of a mesh that is to suit many shapes: the solver's own, or 8 U/V and at least 80.
    ///
    /// Elements longer than V/4 give false energy levels; V/8 is safe.
    pub(crate) fn elements(&self) -> usize {
        self.solver
            .elements
            .unwrap_or_else(|| self.default_elements())
    }

    /// Whether the rib at a support is square: as the support states, else at a clamped end; a closed belt has no ends.
    pub(crate) fn is_square_rib(&self, support: &SupportSpec) -> bool {
        let clamped_end = !self.belt.closed && support.is_square_rib(self.belt.length());
        support.square_rib.unwrap_or(clamped_end)
    }

    /// Number of elements where the scenario names none.
    pub(crate) fn default_elements(&self) -> usize {
        default_elements(self.belt.length(), self.belt.width)
    }

    /// Arc lengths where elements must meet: both ends, joints of segments, supports, links and point loads.
    ///
    /// Places within [`SAME_PLACE`] of each other are one. Rising from 0 to U. Units: m.
    pub(crate) fn break_points(&self) -> Vec<f64> {
        let length = self.belt.length();
        let supports = self.supports.iter().map(|support| support.at);
        let links = self.links.iter().flat_map(|link| [link.from, link.to]);
        let loads = self.loads.points.iter().map(|load| load.at);
        let places = supports.chain(links).chain(loads);
        let mut points: Vec<f64> = places.map(|place| place.arc_length(length)).collect();
        points.extend(self.belt.joints());
        points.retain(|u| *u > SAME_PLACE * length && *u < length * (1.0 - SAME_PLACE));
        points.sort_by(f64::total_cmp);
        points.dedup_by(|u, before| *u - *before <= SAME_PLACE * length);
        points.insert(0, 0.0);
        points.push(length);
        points
    }
}

/// 8 U/V rounded up, 80 to 100 000.
fn default_elements(length: f64, width: f64) -> usize {
    // A decimal U/V such as 0.3/0.1 comes out an ulp too large or too small; it shall not cost one more element.
    let exact = 8.0 * length / width;
    ((exact - 1e-9 * exact).ceil() as usize).clamp(80, 100_000)
}

impl EnergyModel {
    /// The density of a developable belt; of a shell, the density of the limit of no thickness.
    pub(crate) fn developable(self) -> DevelopableEnergy {
        match self {
            Self::Fishbone => DevelopableEnergy::Fishbone,
            Self::Sadowsky => DevelopableEnergy::Sadowsky,
            Self::Wunderlich | Self::Shell => DevelopableEnergy::Wunderlich,
        }
    }
}

impl BeltSpec {
    /// A belt of this width and rigidity, open and flat where nothing acts on it. Units: m, N·m².
    pub fn new(width: f64, rigidity: f64, segments: Vec<SegmentSpec>) -> Self {
        Self {
            width,
            rigidity: Some(rigidity),
            material: None,
            layers: None,
            thickness: None,
            poisson: None,
            natural_bend: 0.0,
            density: 0.0,
            closed: false,
            half_turns: None,
            segments,
        }
    }

    /// Length U of the spine. Units: m.
    pub(crate) fn length(&self) -> f64 {
        self.segments.iter().map(SegmentSpec::length).sum()
    }

    /// Arc lengths of the ends of the segments. Units: m.
    fn joints(&self) -> impl Iterator<Item = f64> {
        self.segments.iter().scan(0.0, |u, segment| {
            *u += segment.length();
            Some(*u)
        })
    }

    /// Flexural rigidity R_f of a belt that has one rigidity throughout; `None` of any other. Units: N·m².
    pub(crate) fn rigidity_value(&self) -> Option<f64> {
        let own = self.own_rigidity();
        let mut values = self.flexible().map(|segment| match segment.rigidity() {
            Some(Rigidity::Constant(value)) => Some(*value),
            Some(Rigidity::Table(_)) => None,
            None => own,
        });
        let first = values.next()??;
        values.all(|value| value == Some(first)).then_some(first)
    }

    /// Flexural rigidity R_f of segments that have none of their own, from `rigidity`, the material or the layers.
    /// Units: N·m².
    pub(crate) fn own_rigidity(&self) -> Option<f64> {
        self.rigidity
            .or_else(|| Some(self.laminate()?.rigidity * self.width))
    }

    /// Poisson's ratio ν: that of the material or the layers, else `poisson`, else [`DEFAULT_POISSON`].
    pub(crate) fn poisson_value(&self) -> f64 {
        let own = self.laminate().map(|laminate| laminate.poisson);
        own.or(self.poisson).unwrap_or(DEFAULT_POISSON)
    }

    /// Mass per length of the spine: that of the material or the layers where they give one, else `density`.
    /// Units: kg/m.
    pub(crate) fn density_value(&self) -> f64 {
        let own = self.laminate().and_then(|laminate| laminate.mass);
        own.map_or(self.density, |mass| mass * self.width)
    }

    /// Stretching stiffness over bending stiffness, E h/D; `None` where no thickness is known. Units: 1/m².
    pub(crate) fn stretching(&self) -> Option<f64> {
        let of_layers = || {
            self.laminate()
                .map(|laminate| laminate.stretching / laminate.rigidity)
        };
        let poisson = self.poisson_value();
        let of_sheet = |thickness: f64| 12.0 * (1.0 - poisson * poisson) / (thickness * thickness);
        of_layers().or_else(|| self.thickness.map(of_sheet))
    }

    /// Heights along ξ above the neutral surface, from the bottom face through the faces between layers to the top face; none
    /// where no thickness is known. Units: m.
    pub(crate) fn faces(&self) -> Vec<f64> {
        let half = self.thickness.map(|thickness| 0.5 * thickness);
        let of_sheet = || half.map_or_else(Vec::new, |half| vec![-half, half]);
        self.laminate().map_or_else(of_sheet, |of| of.faces)
    }

    /// Thickness of the sheet or of all layers, or as given; `None` where the belt is given by its rigidity alone.
    pub(crate) fn thickness_value(&self) -> Option<f64> {
        let sheet = self.material.as_ref().map(|sheet| sheet.thickness);
        let layers = || {
            Some(
                self.layers
                    .as_ref()?
                    .iter()
                    .map(|layer| layer.thickness)
                    .sum(),
            )
        };
        sheet.or_else(layers).or(self.thickness)
    }

    /// Whether the belt's material is given in SI units: by name, or by a Young's modulus that is too large to be in MPa.
    pub fn is_in_si_units(&self) -> bool {
        /// Young's modulus above that of every sheet. Units: MPa.
        const STIFFEST: f64 = 2e6;
        let sheet = self.material.as_ref().and_then(MaterialSpec::layer);
        self.layers.is_some() || sheet.is_some_and(|sheet| sheet.material.young > STIFFEST)
    }

    /// Whether any part of the unloaded belt is bent.
    pub(crate) fn has_natural_bend(&self) -> bool {
        self.segments
            .iter()
            .any(|segment| self.natural_bend_of(segment) != 0.0)
    }

    /// Whether the board is one straight strip.
    fn is_straight(&self) -> bool {
        let straight = |segment| matches!(segment, &SegmentSpec::Straight { .. });
        self.segments.iter().all(straight)
    }

    /// Bend ω_ζ of an unloaded segment: its own, else the belt's; 0 of a segment that is not flexible. Units: rad/m.
    pub(crate) fn natural_bend_of(&self, segment: &SegmentSpec) -> f64 {
        match segment.is_flexible() {
            true => segment.natural_bend().unwrap_or(self.natural_bend),
            false => 0.0,
        }
    }

    fn flexible(&self) -> impl Iterator<Item = &SegmentSpec> {
        self.segments.iter().filter(|segment| segment.is_flexible())
    }

    /// The stack that the belt is made of, from `material` or `layers`.
    fn laminate(&self) -> Option<Laminate> {
        if let Some(sheet) = &self.material {
            return Some(Laminate::of(&[sheet.layer()?]));
        }
        let layers: Option<Vec<Layer>> =
            self.layers.as_ref()?.iter().map(LayerSpec::layer).collect();
        Some(Laminate::of(&layers?))
    }
}

impl MaterialSpec {
    /// The sheet as a layer; `None` where neither a known preset nor the sheet itself gives its constants.
    fn layer(&self) -> Option<Layer> {
        let preset = self.preset.as_deref().and_then(Material::named);
        let density = preset.and_then(|material| material.density);
        let material = Material {
            young: self.young.or(preset.map(|material| material.young))?,
            poisson: self.poisson.or(preset.map(|material| material.poisson))?,
            density: self.density.or(density),
        };
        Some(Layer {
            material,
            thickness: self.thickness,
        })
    }
}

impl LayerSpec {
    /// The layer; `None` of an unknown material.
    fn layer(&self) -> Option<Layer> {
        Some(Layer {
            material: Material::named(&self.material)?,
            thickness: self.thickness,
        })
    }
}

impl RigidityTable {
    /// Rigidity at an arc length from the start of the segment: linear between entries, held outside them.
    /// Units: N·m².
    ///
    /// # Panics
    ///
    /// If the table has no entries.
    pub(crate) fn at(&self, u: f64) -> f64 {
        let next = self.u.partition_point(|entry| *entry <= u);
        if next == 0 || next == self.u.len() {
            return self.value[next.saturating_sub(1)];
        }
        let fraction = (u - self.u[next - 1]) / (self.u[next] - self.u[next - 1]);
        self.value[next - 1] + fraction * (self.value[next] - self.value[next - 1])
    }
}

impl SegmentSpec {
    /// A straight segment with the belt's own rigidity.
    pub fn straight(length: f64) -> Self {
        Self::Straight {
            length,
            natural_bend: None,
            rigidity: None,
        }
    }

    /// Length along the spine; 0 of a corner. Units: m.
    pub(crate) fn length(&self) -> f64 {
        match self {
            Self::Straight { length, .. } | Self::Arc { length, .. } | Self::Rigid { length } => {
                *length
            }
            Self::Corner { .. } => 0.0,
        }
    }

    /// In-plane (geodesic) curvature; 0 but of an arc. Units: rad/m.
    pub(crate) fn curvature(&self) -> f64 {
        match self {
            Self::Arc { curvature, .. } => *curvature,
            Self::Straight { .. } | Self::Corner { .. } | Self::Rigid { .. } => 0.0,
        }
    }

    /// Angle by which the board turns at a point; 0 but of a corner. Units: rad.
    pub(crate) fn angle(&self) -> f64 {
        match self {
            Self::Corner { angle } => *angle,
            Self::Straight { .. } | Self::Arc { .. } | Self::Rigid { .. } => 0.0,
        }
    }

    /// The segment's own rigidity, where it has one.
    pub(crate) fn rigidity(&self) -> Option<&Rigidity> {
        match self {
            Self::Straight { rigidity, .. } | Self::Arc { rigidity, .. } => rigidity.as_ref(),
            Self::Corner { .. } | Self::Rigid { .. } => None,
        }
    }

    /// Bend ω_ζ of the unloaded segment, where it has its own. Units: rad/m.
    pub(crate) fn natural_bend(&self) -> Option<f64> {
        match self {
            Self::Straight { natural_bend, .. } | Self::Arc { natural_bend, .. } => *natural_bend,
            Self::Corner { .. } | Self::Rigid { .. } => None,
        }
    }

    /// Whether the segment bends at all.
    pub(crate) fn is_flexible(&self) -> bool {
        matches!(self, Self::Straight { .. } | Self::Arc { .. })
    }
}

impl Place {
    /// Arc length from the start of a belt of this length; a number within [`SAME_PLACE`] of an end is that end.
    pub(crate) fn arc_length(&self, length: f64) -> f64 {
        match *self {
            Self::Start => 0.0,
            Self::End => length,
            Self::ArcLength(u) if u.abs() <= SAME_PLACE * length => 0.0,
            Self::ArcLength(u) if (u - length).abs() <= SAME_PLACE * length => length,
            Self::ArcLength(u) => u,
        }
    }

    /// Whether this is the start or the end of a belt of this length.
    pub(crate) fn is_end(&self, length: f64) -> bool {
        let u = self.arc_length(length);
        u == 0.0 || u == length
    }
}

impl SupportSpec {
    /// A support at a place that as yet holds nothing.
    pub fn new(at: Place) -> Self {
        Self {
            at,
            position: None,
            rotation: None,
            euler: None,
            quaternion: None,
            hinge: None,
            moment: None,
            square_rib: None,
        }
    }

    /// Frame R = [ξ η ζ] that the support holds; `None` where the orientation is free.
    ///
    /// Shapes: (3, 3), columns ξ, η, ζ.
    /// Source: Eq. (1) for `euler`.
    pub fn frame(&self) -> Option<Matrix3<f64>> {
        if let Some(vector) = self.rotation {
            return Some(exp(&Vector3::from(vector)));
        }
        if let Some([phi, theta, psi]) = self.euler {
            return Some(frame_from_euler(&Euler { phi, theta, psi }));
        }
        let [w, x, y, z] = self.quaternion?;
        let quaternion = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Some(quaternion.to_rotation_matrix().into_inner())
    }

    /// Components of the position that the support holds. Units: m.
    pub(crate) fn components(&self) -> [Option<f64>; 3] {
        self.position.map_or([None; 3], |position| {
            position.map(|component| component.value())
        })
    }

    /// Position that the support holds; `None` where it, or a component of it, is free. Units: m.
    pub fn point(&self) -> Option<Vector3<f64>> {
        let [x, y, z] = self.components();
        Some(Vector3::new(x?, y?, z?))
    }

    /// Whether the rib is square to the spine, β = 0, on a belt of this length.
    ///
    /// Source: Eq. (45)–(50) for connectors.
    pub(crate) fn is_square_rib(&self, length: f64) -> bool {
        self.square_rib.unwrap_or_else(|| {
            self.at.is_end(length) && self.position.is_some() && self.has_orientation()
        })
    }

    fn has_orientation(&self) -> bool {
        self.rotation.is_some() || self.euler.is_some() || self.quaternion.is_some()
    }
}

impl Component {
    /// The coordinate held; `None` where it is free. Units: m.
    pub(crate) fn value(&self) -> Option<f64> {
        match *self {
            Self::Held(value) => Some(value),
            Self::Free => None,
        }
    }
}
