//! Inertia of the second variation at a solution, on the tangent space of the equalities and the active inequalities.
//!
//! By Sylvester's law of inertia, the factorisation of a symmetric matrix has as many negative pivots as the matrix has
//! negative eigenvalues.

use super::chain::ByControls;
use super::kkt::Kkt;
use super::symmetries::{Motions, zero_modes};
use crate::linearisation::Linearisation;
use crate::program::{Scales, Values};
use nalgebra::SMatrix;

/// Eigenvalue below which the second variation is zero; in [`Scales::eigenvalue`].
const ZERO: f64 = 1e-2;
/// Ratio of multiplier per weight to slack above which an inequality is clearly active, and below the inverse of which it is
/// clearly inactive; multiplier per weight and slack.
const CLEAR: f64 = 100.0;

/// Numbers of eigenvalues of the second variation by their sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Inertia {
    /// Number of negative eigenvalues.
    pub negative: usize,
    /// Number of eigenvalues near zero, of either sign, beside the symmetries.
    pub zero: usize,
    /// Number of independent symmetries of the programme, along which nothing changes; they are in neither of the other
    /// numbers.
    pub symmetries: usize,
    /// Number of cost-free controls, along which neither state nor objective changes; they are in neither of the other
    /// numbers.
    pub cost_free: usize,
}

impl<const X: usize, const U: usize, const N: usize> Kkt<X, U, N> {
    /// Inertia of the second variation; `None` where it depends on inequalities that are neither clearly active nor clearly
    /// inactive. Overwrites the derivatives.
    ///
    /// Clearly inactive inequalities count with the stiffness of the last barrier. It is far below the second derivatives of
    /// the objective, but for controls that hardly change it: these are where the barrier has its minimum, not the objective.
    pub(crate) fn inertia(
        &mut self,
        values: &Values,
        multipliers: &[f64],
        metric: &[SMatrix<f64, X, X>],
        symmetries: &Motions<N>,
        scales: &Scales,
    ) -> Option<Inertia> {
        let cost_free = self.linear.hold_cost_free_controls();
        let symmetries = zero_modes(metric, symmetries);
        let zero = ZERO * scales.eigenvalue();
        let clear =
            |slack: f64, multiplier: f64| multiplier > CLEAR * slack || CLEAR * multiplier <= slack;
        let doubtful = |_: f64, _: f64| true;
        let mut below = |shift: f64, active: fn(f64, f64) -> bool| {
            self.assemble_where(values, multipliers, active);
            self.shift(metric, shift);
            self.count_negative_beside(&symmetries).ok()
        };
        let not_positive = below(zero, clear)?;
        let negative = match not_positive {
            0 => 0,
            _ => below(-zero, clear)?,
        };
        let is_in_doubt = not_positive > 0 && below(-zero, doubtful)? != negative;
        (!is_in_doubt).then_some(Inertia {
            negative,
            zero: not_positive.saturating_sub(negative),
            symmetries: symmetries.len(),
            cost_free,
        })
    }
}

impl<const X: usize, const U: usize, const N: usize> Linearisation<X, U, N> {
    /// Locks the cost-free controls, which change neither a state nor the objective to second order, and counts them.
    pub(super) fn hold_cost_free_controls(&mut self) -> usize {
        let mut cost_free = self.cost_free_controls();
        for (k, stage) in self.chain.stages.iter().enumerate().rev() {
            let next = cost_free[k + 1];
            let Some(tie) = stage.tie else { continue };
            for (i, cost_free) in cost_free[k].iter_mut().enumerate() {
                *cost_free &= (0..U).all(|follower| tie[(follower, i)] == 0.0 || next[follower]);
            }
        }
        let mut held = 0;
        let stages = self.chain.stages.iter_mut().map(|stage| &mut stage.free);
        let free = std::iter::once(&mut self.chain.first_free).chain(stages);
        for (free, cost_free) in free.zip(cost_free) {
            for i in 0..U {
                held += usize::from(free[i] && cost_free[i]);
                free[i] &= !cost_free[i];
            }
        }
        held
    }

    /// The cost-free controls of every node: those whose growth of the state and whose second derivatives are far below the
    /// largest of the node's controls.
    ///
    /// Other nodes are no measure: where a density is stiff in a single stage, its second derivatives are larger than those
    /// elsewhere by any factor.
    fn cost_free_controls(&self) -> Vec<[bool; U]> {
        /// Ratio to the largest derivative of a node's controls up to which a control is cost-free; dimensionless.
        const COST_FREE: f64 = 1e-8;
        let is_cost_free = |most: &[[f64; 2]; U]| {
            let largest = most.iter().fold([0.0; 2], |a: [f64; 2], b| maxima(a, *b));
            most.map(|own| [0, 1].iter().all(|i| own[*i] <= COST_FREE * largest[*i]))
        };
        self.largest_derivatives()
            .iter()
            .map(is_cost_free)
            .collect()
    }

    /// The largest derivatives by every control of every node: growth of the state, then second derivatives.
    fn largest_derivatives(&self) -> Vec<[[f64; 2]; U]> {
        let mut most = vec![[[0.0; 2]; U]; self.chain.stages.len() + 1];
        let mut see = |node: usize, i: usize, growth: f64, second: f64| {
            most[node][i] = maxima(most[node][i], [growth, second]);
        };
        let column = |of: &ByControls<U, N>, i: usize| of.column(i).amax();
        let stages = self.chain.stages.iter().zip(&self.diagonal.controls);
        for (k, (stage, controls)) in stages.enumerate() {
            for i in 0..U {
                let first = column(&stage.state_first, i)
                    .max(controls.first.column(i).amax())
                    .max(controls.mixed.row(i).amax());
                let second = column(&stage.state_second, i)
                    .max(controls.second.column(i).amax())
                    .max(controls.mixed.column(i).amax());
                see(k, i, column(&stage.growth_by_first, i), first);
                see(k + 1, i, column(&stage.growth_by_second, i), second);
            }
        }
        for term in &self.diagonal.nodes {
            for i in 0..U {
                see(term.node, i, 0.0, term.hessian.column(X + i).amax());
            }
        }
        for ([first, second], hessian) in self.pair_hessians() {
            for i in 0..U {
                let by_first = hessian.first.column(X + i).amax();
                let by_second = hessian.second.column(X + i).amax();
                see(first, i, 0.0, by_first.max(hessian.mixed.row(X + i).amax()));
                see(
                    second,
                    i,
                    0.0,
                    by_second.max(hessian.mixed.column(X + i).amax()),
                );
            }
        }
        most
    }
}

/// The larger of each of two numbers.
fn maxima(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].max(b[0]), a[1].max(b[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Layout;
    use nalgebra::{Matrix2, Vector3};

    /// A chain whose first control moves the state and whose second one costs, by a share of a stage each.
    fn chain(second: impl Fn(usize) -> f64) -> Linearisation<1, 2, 3> {
        let stages = 100;
        let share = 1.0 / stages as f64;
        let mut linear = Linearisation::new(Layout::new(vec![share; stages]));
        for (k, stage) in linear.chain.stages.iter_mut().enumerate() {
            let growth = ByControls::from_columns(&[Vector3::x() * share, Vector3::zeros()]);
            (stage.growth_by_first, stage.growth_by_second) = (growth, growth);
            let own = SMatrix::<f64, 2, 2>::new(share, 0.0, 0.0, share * second(k));
            let controls = &mut linear.diagonal.controls[k];
            (controls.first, controls.second) = (own, own);
        }
        linear
    }

    #[test]
    fn test_control_is_cost_free_where_it_changes_nothing_and_only_there() {
        assert_eq!(chain(|_| 1.0).hold_cost_free_controls(), 0);
        // The second control of the nodes 0 to 39 changes nothing; a stage beyond is stiffer than the rest by 1e12.
        let mut linear = chain(|k| match k {
            0..40 => 1e-12,
            70 => 1e12,
            _ => 1.0,
        });
        assert_eq!(linear.hold_cost_free_controls(), 40);
        let free = linear.chain.stages.iter().map(|stage| stage.free);
        assert!(free.clone().all(|free| free[0]));
        assert_eq!(free.filter(|free| !free[1]).count(), 39);
    }

    #[test]
    fn test_control_is_cost_free_where_all_that_follow_it_are() {
        let held = |tie: Matrix2<f64>| {
            let mut linear = chain(|k| if k < 40 { 1e-12 } else { 1.0 });
            linear.chain.stages[20].tie = Some(tie);
            linear.hold_cost_free_controls()
        };
        // Beyond the stage the first control moves the state, and the second changes nothing.
        assert_eq!(held(Matrix2::new(0.5, 0.0, 0.5, 0.5)), 40);
        assert_eq!(held(Matrix2::new(0.5, 0.5, 0.5, 0.5)), 39);
    }
}
