//! Sheet materials by name, and the bending of laminates.

/// An isotropic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Material {
    /// Young's modulus E. Units: Pa.
    pub young: f64,
    /// Poisson's ratio ν.
    pub poisson: f64,
    /// Mass per volume, where known. Units: kg/m³.
    pub density: Option<f64>,
}

/// One layer of a laminate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Layer {
    /// Material of the layer.
    pub material: Material,
    /// Thickness t. Units: m.
    pub thickness: f64,
}

/// Bending data of a stack of bonded layers; a single sheet is a stack of one layer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Laminate {
    /// Heights above the neutral surface, from the bottom face through the faces between layers to the top face. Units: m.
    pub faces: Vec<f64>,
    /// Flexural rigidity per width, D₁₁. Units: N·m.
    pub rigidity: f64,
    /// Stretching stiffness along the strip per width, E h of a sheet: free to contract across. Units: N/m.
    pub stretching: f64,
    /// Effective Poisson's ratio of bending, D₁₂/D₁₁.
    pub poisson: f64,
    /// Mass per area, where every layer's density is known. Units: kg/m².
    pub mass: Option<f64>,
}

/// Materials by name, in the units of [`Material`]; names are compared without regard to case, spaces, underscores and
/// hyphens.
pub(crate) const PRESETS: [(&str, Material); 7] = [
    ("polyimide", POLYIMIDE),
    ("rolled-copper", ROLLED_COPPER),
    ("PET", PET),
    ("polystyrene", POLYSTYRENE),
    ("FR-4", FR_4),
    ("stainless-steel", STAINLESS_STEEL),
    ("acrylic-adhesive", ACRYLIC_ADHESIVE),
];

/// Polyimide film at 23 °C, in the units of [`Material`].
///
/// Source: DuPont, Kapton HN data sheet; Poisson's ratio from the same maker's summary of properties.
pub(crate) const POLYIMIDE: Material = Material::new(2.5e9, 0.34, 1420.0);

/// Rolled, annealed copper, in the units of [`Material`].
///
/// Rolling texture makes foils softer along some directions than this value for the bulk.
///
/// Source: data sheets of electrolytic tough pitch copper, UNS C11000.
pub(crate) const ROLLED_COPPER: Material = Material::new(117e9, 0.34, 8940.0);

/// Biaxially oriented polyester film, mean of both directions, in the units of [`Material`].
///
/// Source: DuPont Teijin Films, Mylar bulletin H-37232, type 92A; Poisson's ratio before yield.
pub(crate) const PET: Material = Material::new(4.9e9, 0.38, 1390.0);

/// General-purpose polystyrene, in the units of [`Material`].
///
/// Source: handbook values, inside the ranges of CRC and Cardarelli, Materials Handbook.
pub(crate) const POLYSTYRENE: Material = Material::new(3.2e9, 0.34, 1050.0);

/// Woven glass in epoxy, along the warp, in the units of [`Material`]; across the warp, E is about 21 GPa.
///
/// Source: the commonly tabulated values of NEMA grade FR-4; makers differ by some 10 %.
pub(crate) const FR_4: Material = Material::new(24e9, 0.136, 1850.0);

/// Austenitic stainless steel, AISI 304, in the units of [`Material`].
///
/// Source: data sheets of AISI 304, UNS S30400.
pub(crate) const STAINLESS_STEEL: Material = Material::new(193e9, 0.29, 8000.0);

/// Acrylic bonding sheet of flexible circuits at 23 °C, in the units of [`Material`].
///
/// An estimate for a rubber-toughened acrylic: the makers' data sheets give no elastic constants, and they change with
/// temperature and rate. Give `young` where it matters.
pub(crate) const ACRYLIC_ADHESIVE: Material = Material::new(0.2e9, 0.42, 1200.0);

impl Material {
    const fn new(young: f64, poisson: f64, density: f64) -> Self {
        Self {
            young,
            poisson,
            density: Some(density),
        }
    }

    /// The material of a name in [`PRESETS`].
    pub(crate) fn named(name: &str) -> Option<Self> {
        let (_, material) = PRESETS.iter().find(|(known, _)| key(known) == key(name))?;
        Some(*material)
    }

    /// Plane-strain modulus E/(1 − ν²): a wide strip cannot contract across its width.
    fn plane_strain(&self) -> f64 {
        self.young / (1.0 - self.poisson * self.poisson)
    }
}

/// A name in its compared form: lower case, without separators.
fn key(name: &str) -> String {
    name.chars()
        .filter(|c| !matches!(c, ' ' | '_' | '-'))
        .flat_map(char::to_lowercase)
        .collect()
}

impl Laminate {
    /// The laminate of these layers, from bottom (−ξ) to top, in plane strain about its neutral surface.
    ///
    /// With Q = E/(1 − ν²): z₀ = ΣQ t z/ΣQ t, D₁₁ = ΣQ I, D₁₂ = Σν Q I, where z is a layer's middle and I its
    /// ∫(z − z₀)² dz. Of one layer, D₁₁ = E t³/(12 (1 − ν²)).
    ///
    /// Source: classical laminate theory, as in Jones, Mechanics of Composite Materials.
    pub(crate) fn of(layers: &[Layer]) -> Self {
        let middles = middles(layers);
        let stretch = |layer: &Layer| layer.material.plane_strain() * layer.thickness;
        let moment: f64 = layers
            .iter()
            .zip(&middles)
            .map(|(l, z)| stretch(l) * z)
            .sum();
        let neutral = moment / layers.iter().map(stretch).sum::<f64>();
        let (mut rigidity, mut coupling) = (0.0, 0.0);
        for (layer, z) in layers.iter().zip(&middles) {
            let arm = layer.thickness * layer.thickness / 12.0 + (z - neutral) * (z - neutral);
            rigidity += stretch(layer) * arm;
            coupling += layer.material.poisson * stretch(layer) * arm;
        }
        let contraction = |layer: &Layer| layer.material.poisson * stretch(layer);
        let [along, across]: [f64; 2] = [
            layers.iter().map(stretch).sum(),
            layers.iter().map(contraction).sum(),
        ];
        let tops = layers.iter().scan(-neutral, |top, layer| {
            *top += layer.thickness;
            Some(*top)
        });
        Self {
            faces: [-neutral].into_iter().chain(tops).collect(),
            rigidity,
            stretching: along - across * across / along,
            poisson: coupling / rigidity,
            mass: layers.iter().map(Layer::mass).sum(),
        }
    }
}

impl Layer {
    /// Mass per area. Units: kg/m².
    fn mass(&self) -> Option<f64> {
        Some(self.material.density? * self.thickness)
    }
}

/// Heights of the layers' middles above the bottom.
fn middles(layers: &[Layer]) -> Vec<f64> {
    let mut top = 0.0;
    let middle = |layer: &Layer| {
        top += layer.thickness;
        top - 0.5 * layer.thickness
    };
    layers.iter().map(middle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn layer(material: Material, thickness: f64) -> Layer {
        Layer {
            material,
            thickness,
        }
    }

    /// A flexible circuit of one copper layer: base film, adhesive, copper, adhesive, cover film.
    fn circuit() -> [Layer; 5] {
        [
            layer(POLYIMIDE, 25e-6),
            layer(ACRYLIC_ADHESIVE, 25e-6),
            layer(ROLLED_COPPER, 35e-6),
            layer(ACRYLIC_ADHESIVE, 25e-6),
            layer(POLYIMIDE, 25e-6),
        ]
    }

    #[test]
    fn test_a_sheet_bends_as_a_plate() {
        let sheet = Laminate::of(&[layer(PET, 1e-4)]);
        let expected = 4.9e9 * 1e-12 / (12.0 * (1.0 - 0.38 * 0.38));
        assert_relative_eq!(sheet.rigidity, expected, max_relative = 1e-14);
        assert_relative_eq!(sheet.faces[0], -0.5e-4, max_relative = 1e-14);
        assert_relative_eq!(sheet.faces[1], 0.5e-4, max_relative = 1e-14);
        assert_relative_eq!(sheet.poisson, 0.38, max_relative = 1e-14);
        assert_relative_eq!(sheet.mass.unwrap_or_default(), 0.139, max_relative = 1e-14);
    }

    #[test]
    fn test_a_sheet_cut_into_layers_is_the_same_sheet() {
        let whole = Laminate::of(&[layer(PET, 1e-4)]);
        let cut = Laminate::of(&[layer(PET, 2e-5), layer(PET, 5e-5), layer(PET, 3e-5)]);
        assert_relative_eq!(cut.rigidity, whole.rigidity, max_relative = 1e-13);
        assert_relative_eq!(cut.faces[0], whole.faces[0], max_relative = 1e-13);
        assert_relative_eq!(cut.faces[3], whole.faces[1], max_relative = 1e-13);
        assert_relative_eq!(cut.faces[1], -3e-5, max_relative = 1e-13);
        assert_relative_eq!(cut.poisson, whole.poisson, max_relative = 1e-13);
    }

    #[test]
    fn test_two_layers_of_moduli_1_and_3_bend_as_worked_out_by_hand() {
        // The layers have thickness 1 each: z₀ = (0.5 + 3·1.5)/4 = 1.25; D₁₁ = 1/12 + 0.75² + 3/12 + 3·0.25² = 13/12.
        let of = |young, poisson: f64| Material {
            young: young * (1.0 - poisson * poisson),
            poisson,
            density: None,
        };
        let laminate = Laminate::of(&[layer(of(1.0, 0.0), 1.0), layer(of(3.0, 0.4), 1.0)]);
        for (face, height) in laminate.faces.iter().zip([-1.25, -0.25, 0.75]) {
            assert_relative_eq!(*face, height, max_relative = 1e-14);
        }
        assert_relative_eq!(laminate.rigidity, 13.0 / 12.0, max_relative = 1e-14);
        // The upper layer's part of D₁₁ is (1/4 + 3/16)/(13/12) = 21/52.
        assert_relative_eq!(laminate.poisson, 0.4 * 21.0 / 52.0, max_relative = 1e-14);
        assert_eq!(laminate.mass, None);
    }

    #[test]
    fn test_a_symmetric_circuit_bends_about_its_middle() {
        let laminate = Laminate::of(&circuit());
        assert_relative_eq!(laminate.faces[0], -67.5e-6, max_relative = 1e-13);
        assert_eq!(laminate.faces.len(), 6);
        let turned: Vec<Layer> = circuit().into_iter().rev().collect();
        assert_relative_eq!(
            Laminate::of(&turned).rigidity,
            laminate.rigidity,
            max_relative = 1e-13
        );
        // Copper about its own middle, films at 55 µm from it, adhesive at 30 µm, each E/(1 − ν²).
        let part =
            |m: Material, t: f64, arm: f64| m.plane_strain() * (t.powi(3) / 12.0 + t * arm * arm);
        let expected = part(ROLLED_COPPER, 35e-6, 0.0)
            + 2.0 * part(POLYIMIDE, 25e-6, 55e-6)
            + 2.0 * part(ACRYLIC_ADHESIVE, 25e-6, 30e-6);
        assert_relative_eq!(laminate.rigidity, expected, max_relative = 1e-13);
    }

    #[test]
    fn test_rigidity_of_a_laminate_lies_between_those_of_its_materials() {
        let of = |material| Laminate::of(&[layer(material, 135e-6)]).rigidity;
        let rigidity = Laminate::of(&circuit()).rigidity;
        assert!(of(ACRYLIC_ADHESIVE) < rigidity && rigidity < of(ROLLED_COPPER));
    }

    #[test]
    fn test_names_are_compared_without_case_and_separators() {
        for name in ["FR-4", "fr4", "Fr 4", "FR_4"] {
            assert_eq!(Material::named(name), Some(FR_4), "{name}");
        }
        assert_eq!(Material::named("Rolled Copper"), Some(ROLLED_COPPER));
        assert_eq!(Material::named("copper"), None);
        assert_eq!(Material::named(""), None);
    }

    #[test]
    fn test_presets_are_solids_in_si_units() {
        for (name, material) in PRESETS {
            assert_eq!(Material::named(name), Some(material));
            assert!((1e7..1e12).contains(&material.young), "{name}");
            assert!((0.0..0.5).contains(&material.poisson), "{name}");
            let density = material.density.unwrap_or_default();
            assert!((900.0..10_000.0).contains(&density), "{name}");
        }
    }
}
