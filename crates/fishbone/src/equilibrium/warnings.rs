//! Warnings to read before a result is relied on.

use super::{Equilibrium, Status};
use crate::problem::number;
use crate::scenario::BeltSpec;
use crate::surface;

impl Equilibrium {
    /// Warnings to read before the result is relied on, one line each.
    pub fn warnings(&self) -> Vec<String> {
        self.warnings_with(surface::crosses_itself(&self.spine))
    }

    /// The warnings, where the self-crossing is known.
    pub(crate) fn warnings_with(&self, crossing: Option<[f64; 2]>) -> Vec<String> {
        let crossing = crossing.filter(|_| self.status == Status::Converged);
        let scales = implausible_scales(&self.scenario().belt);
        let fixed = self.problem.has_fixed_mesh();
        let coarse = self.too_coarse_for_width().filter(|_| fixed);
        let mesh = coarse.into_iter().chain(self.inaccurate());
        let solve = self.warnings.iter().cloned().chain(mesh);
        solve.chain(scales).chain(crossing.map(crossed)).collect()
    }
}

impl Equilibrium {
    /// The warning of a mesh that is too coarse for the accuracy.
    fn inaccurate(&self) -> Option<String> {
        let (accuracy, fixed) = (self.problem.accuracy(), self.problem.has_fixed_mesh());
        self.certified_any().ok()?;
        let Some(error) = self.error() else {
            return Some(
                "the error by the mesh could not be estimated: a mesh twice as fine has no equilibrium next to this one"
                    .to_owned(),
            );
        };
        let (name, largest) = error.worst()?;
        let remedy = match fixed {
            true => "leave out solver.elements, or raise it".to_owned(),
            false => {
                let elements = self.spine.strips().count();
                format!("its mesh of {elements} elements was not refined further")
            }
        };
        (largest > accuracy).then(|| {
            format!(
                "the estimated error of the {name}, {largest:.1e}, is above solver.accuracy, {}: {remedy}",
                number(accuracy)
            )
        })
    }

    /// The warning of elements that are too long for the width.
    fn too_coarse_for_width(&self) -> Option<String> {
        /// Elements for each width V that are safe, a number: strong twist makes facets of the scale of V, which longer
        /// elements cannot resolve.
        const SAFE: f64 = 8.0;
        let (spine, width) = (&self.spine, self.spine.width);
        let longest = spine.strips().map(|element| spine.element_length(element));
        let longest = longest.fold(0.0, f64::max) / width;
        (longest * SAFE > 1.0 + 1e-9).then(|| {
            format!(
                "elements of {longest:.2} V may settle on a false level: V/8 is safe, so leave out solver.elements, or raise it \
                 to {:.0}",
                (SAFE * spine.length() / width).ceil()
            )
        })
    }
}

fn crossed([a, b]: [f64; 2]) -> String {
    format!(
        "the belt crosses itself at u = {} and u = {}: contact is outside the model",
        number(a),
        number(b)
    )
}

/// The warning of lengths, or of a modulus, that are hardly in the units of the rest; at most one.
fn implausible_scales(belt: &BeltSpec) -> Option<String> {
    hardly_metres(belt)
        .or_else(|| no_strip(belt))
        .or_else(|| hardly_pascal(belt))
}

/// The warning of a belt that is no thin strip in whatever units.
fn no_strip(belt: &BeltSpec) -> Option<String> {
    /// Thickness from which a belt is no thin strip, in V.
    const THICK: f64 = 0.25;
    let (length, width) = (belt.length(), belt.width);
    let thick = belt.thickness_value().filter(|t| *t > THICK * width);
    let thick = thick.map(|thickness| {
        format!(
            "a belt {} thick and {} wide is no thin strip: thicknesses are in the unit of length of the rest",
            number(thickness),
            number(width)
        )
    });
    let wide = (width > length).then(|| {
        format!(
            "a belt {} wide and {} long is no strip: widths are in the unit of length of the rest",
            number(width),
            number(length)
        )
    });
    thick.or(wide)
}

/// The warning of lengths that are hardly metres, of a belt whose material is in SI units.
fn hardly_metres(belt: &BeltSpec) -> Option<String> {
    /// Length from which a belt is longer than the belts that are made of thin sheets. Units: m.
    const LONG: f64 = 5.0;
    /// Width from which a belt is wider than those. Units: m.
    const WIDE: f64 = 0.5;
    /// Thickness from which a sheet is not thin. Units: m.
    const THICK: f64 = 5e-3;
    /// Length from which a belt is longer than those of a thin sheet, in thicknesses.
    const SLIGHT: f64 = 1e5;
    /// Force scale R_f/U² from which a belt is stiffer than thin sheets are. Units: N.
    const STIFF: f64 = 1e3;
    let rigidity = belt.own_rigidity().filter(|_| belt.is_in_si_units())?;
    let (length, width, thickness) = (belt.length(), belt.width, belt.thickness_value()?);
    let force = rigidity / (length * length);
    let is_large = length > LONG || width > WIDE || thickness > THICK;
    (is_large || length > SLIGHT * thickness || force > STIFF).then(|| {
        format!(
            "the material is in SI units, and so the belt is {} m long, {} m wide and {} m thick, and its force scale R_f/U² \
             is {force:.1e} N: lengths are in metres, perhaps millimetres were meant",
            number(length),
            number(width),
            number(thickness)
        )
    })
}

/// The warning of a Young's modulus that is hardly in Pa, of a belt whose lengths are hardly in millimetres.
fn hardly_pascal(belt: &BeltSpec) -> Option<String> {
    /// Young's modulus of the softest sheets. Units: Pa.
    const SOFT: f64 = 3e5;
    /// Length of a belt that is short in metres, and too short to be made in millimetres.
    const SHORT: f64 = 1.0;
    let young = belt.material.as_ref()?.young?;
    (young < SOFT && belt.length() < SHORT).then(|| {
        format!(
            "young is {}, and the belt {} long: with lengths in metres young is in Pa, perhaps a number of MPa or GPa was given",
            number(young),
            number(belt.length())
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{LayerSpec, MaterialSpec, SegmentSpec};

    fn belt(unit: f64, young: Option<f64>, preset: Option<&str>) -> BeltSpec {
        let mut belt = BeltSpec::new(8.0 * unit, 1.0, vec![SegmentSpec::straight(60.0 * unit)]);
        belt.rigidity = None;
        belt.material = Some(MaterialSpec {
            preset: preset.map(str::to_owned),
            young,
            poisson: Some(0.3),
            thickness: 0.1 * unit,
            density: None,
        });
        belt
    }

    #[test]
    fn test_lengths_in_millimetres_are_warned_of_where_the_material_is_in_pascal() {
        for (young, preset) in [
            (None, Some("polyimide")),
            (Some(3e9), None),
            (Some(7e6), None),
        ] {
            assert_eq!(implausible_scales(&belt(1e-3, young, preset)), None);
            let warning = implausible_scales(&belt(1.0, young, preset)).unwrap();
            assert!(warning.contains("60 m long") && warning.contains("millimetres"));
        }
    }

    #[test]
    fn test_short_belts_in_millimetres_are_known_by_their_forces() {
        let mut short = belt(1.0, None, Some("polyimide"));
        short.segments = vec![SegmentSpec::straight(4.0)];
        let warning = implausible_scales(&short).unwrap();
        // E t³ V/(12 (1 − ν²) U²), E = 2.5e9 or more
        assert!(warning.contains("force scale R_f/U² is 1."), "{warning}");
    }

    /// A sheet of polyimide, or of a material with a Young's modulus: width, length, thickness.
    fn sheet(young: Option<f64>, [width, length, thickness]: [f64; 3]) -> Option<String> {
        let mut belt = belt(1.0, young, young.is_none().then_some("polyimide"));
        belt.width = width;
        belt.segments = vec![SegmentSpec::straight(length)];
        belt.material.as_mut().unwrap().thickness = thickness;
        implausible_scales(&belt)
    }

    #[test]
    fn test_boards_of_a_few_millimetres_are_warned_of_with_any_thickness() {
        for [width, length] in [[3.0, 4.0], [1.0, 5.0], [0.4, 4.0]] {
            for thickness in [0.025, 0.1, 25e-6] {
                let warning = sheet(None, [width, length, thickness]).unwrap();
                assert!(warning.contains("millimetres were meant"), "{warning}");
            }
            let in_metres = [width, length, 0.025].map(|length| 1e-3 * length);
            assert_eq!(sheet(None, in_metres), None);
        }
    }

    #[test]
    fn test_one_length_in_another_unit_is_warned_of() {
        let warnings = [
            ([8.0, 0.06, 1e-4], "8 m wide"),
            ([0.008, 0.06, 0.1], "0.1 m thick"),
            ([0.008, 60.0, 1e-4], "60 m long"),
            ([0.1, 1.0, 0.02], "0.02 m thick"),
        ];
        for (lengths, part) in warnings {
            let warning = sheet(None, lengths).unwrap();
            assert!(warning.contains(part), "{warning}");
        }
        let in_newton_and_millimetre = [
            ([70.0, 60.0, 0.1], "70 wide and 60 long"),
            ([8.0, 60.0, 100.0], "100 thick and 8 wide"),
        ];
        for (lengths, part) in in_newton_and_millimetre {
            let warning = sheet(Some(2500.0), lengths).unwrap();
            assert!(warning.contains(part), "{warning}");
        }
        // The tape of the validation: 25 µm, 0.1 × 1 m.
        assert_eq!(sheet(None, [0.1, 1.0, 25e-6]), None);
    }

    #[test]
    fn test_numbers_of_other_units_for_the_modulus_are_warned_of() {
        let metres = [0.008, 0.06, 1e-4];
        for young in [2.5, 2500.0, 2e5] {
            let warning = sheet(Some(young), metres).unwrap();
            assert!(warning.contains("young is in Pa"), "{warning}");
        }
        for young in [1e6, 2.5e9, 2e11] {
            assert_eq!(sheet(Some(young), metres), None);
        }
        assert_eq!(sheet(Some(2500.0), [8.0, 60.0, 0.1]), None);
    }

    #[test]
    fn test_units_of_other_belts_are_not_known() {
        // Newton and millimetre: the modulus is in MPa.
        assert_eq!(implausible_scales(&belt(1.0, Some(2e5), None)), None);
        let plain = BeltSpec::new(8.0, 1e9, vec![SegmentSpec::straight(60.0)]);
        assert_eq!(implausible_scales(&plain), None);
    }

    #[test]
    fn test_layers_are_in_si_units() {
        let mut belt = belt(1.0, Some(2e5), None);
        belt.material = None;
        belt.layers = Some(vec![LayerSpec {
            material: "polyimide".to_owned(),
            thickness: 0.1,
        }]);
        assert!(implausible_scales(&belt).is_some());
    }
}
