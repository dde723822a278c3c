//! The energy of one element of a developable belt, with derivatives.

use crate::geometry::gauss_points;
use crate::strip::developable::{DevelopableEnergy, Term};
use crate::strip::element::{Element, GaussFields};
use crate::strip::ribs::{Across, SlopeJet};
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector4};

/// A function of the four unknowns with its derivatives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Jet {
    /// Value.
    pub value: f64,
    /// Gradient.
    pub gradient: Vector4<f64>,
    /// Hessian.
    pub hessian: Matrix4<f64>,
}

impl Jet {
    fn zero() -> Self {
        Self {
            value: 0.0,
            gradient: Vector4::zeros(),
            hessian: Matrix4::zeros(),
        }
    }

    fn add(&mut self, other: &Self) {
        self.value += other.value;
        self.gradient += other.gradient;
        self.hessian += other.hessian;
    }

    /// Adds a term of the density at parameter t of the element.
    fn add_term(&mut self, weight: f64, term: &Term, t: f64) {
        let inputs = fields_by_nodes(t);
        self.value += weight * term.value;
        self.gradient += weight * inputs.tr_mul(&term.gradient);
        self.hessian += weight * inputs.tr_mul(&(term.hessian * inputs));
    }

    fn times(&self, factor: &Self) -> Self {
        let mixed = self.gradient * factor.gradient.transpose();
        Self {
            value: self.value * factor.value,
            gradient: self.value * factor.gradient + factor.value * self.gradient,
            hessian: self.value * factor.hessian
                + factor.value * self.hessian
                + mixed
                + mixed.transpose(),
        }
    }
}

impl From<SlopeJet> for Jet {
    fn from(jet: SlopeJet) -> Self {
        let (g, h) = (jet.gradient, jet.hessian);
        let mut hessian = Matrix4::zeros();
        for (i, row) in [1, 3].into_iter().enumerate() {
            for (j, column) in [1, 3].into_iter().enumerate() {
                hessian[(row, column)] = h[(i, j)];
            }
        }
        Self {
            value: jet.value,
            gradient: Vector4::new(0.0, g[0], 0.0, g[1]),
            hessian,
        }
    }
}

impl Element {
    /// Energy, without derivatives.
    pub(crate) fn energy(&self, model: DevelopableEnergy, fields: &Vector4<f64>) -> f64 {
        let gauss = GaussFields::at(fields);
        let across = if model.knows_width() {
            self.strips().across([fields[1], fields[3]])
        } else {
            Across::PLAIN
        };
        let at = |i: usize| {
            let density = model.value(gauss.bend[i], gauss.slope[i], &self.curl, &across);
            0.5 * self.length * self.rigidity[i] * density
        };
        at(0) + at(1)
    }

    /// Factors of the width in the terms of the energy, with derivatives.
    pub(crate) fn across_jets(
        &self,
        model: DevelopableEnergy,
        fields: &Vector4<f64>,
    ) -> Across<SlopeJet> {
        match model.knows_width() {
            true => self.strips().across_jets([fields[1], fields[3]]),
            false => Across::PLAIN.map(SlopeJet::constant),
        }
    }

    /// The part of the energy that the natural bend adds, with its derivatives.
    pub(crate) fn curl_jet(
        &self,
        model: DevelopableEnergy,
        fields: &Vector4<f64>,
        across: &Across<SlopeJet>,
    ) -> Jet {
        let gauss = GaussFields::at(fields);
        let mixed = self.integral(&gauss, |bend, slope| model.mixed(bend, slope, &self.curl));
        let natural = self.integral(&gauss, |_, slope| model.natural(slope, &self.curl));
        let mut sum = mixed.times(&Jet::from(across.length));
        sum.add(&natural.times(&Jet::from(across.area)));
        sum
    }

    /// Integral of R_f times a term of the density.
    fn integral(&self, gauss: &GaussFields, term: impl Fn(f64, f64) -> Term) -> Jet {
        let mut sum = Jet::zero();
        for (i, t) in gauss_points().into_iter().enumerate() {
            let weight = 0.5 * self.length * self.rigidity[i];
            sum.add_term(weight, &term(gauss.bend[i], gauss.slope[i]), t);
        }
        sum
    }
}

/// Derivative of (bend, slope) at parameter t of an element by the nodal unknowns.
fn fields_by_nodes(t: f64) -> Matrix2x4<f64> {
    let (own, next) = (Matrix2::identity() * (1.0 - t), Matrix2::identity() * t);
    Matrix2x4::from_columns(&[own.column(0), own.column(1), next.column(0), next.column(1)])
}
