//! The filter of the line search: pairs of violation and merit that no later point may be dominated by.

/// Violation and merit of a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measure {
    /// 1-norm of the constraint violation.
    pub(super) violation: f64,
    /// Barrier function.
    pub(super) merit: f64,
}

/// The entries of the filter.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    entries: Vec<Measure>,
    most: f64,
    small: f64,
}

/// Margin of the filter in the violation, as a share of the violation; dimensionless.
const VIOLATION_MARGIN: f64 = 1e-5;
/// Margin of the filter in the merit, per unit violation; objective per unit violation.
const MERIT_MARGIN: f64 = 1e-5;
/// Ratio of the decrease of the merit to its linear prediction that is sufficient (Armijo); dimensionless.
const SUFFICIENT: f64 = 1e-4;

impl Filter {
    /// A filter of a minimisation, by the violation of its start.
    pub(super) fn new(violation: f64) -> Self {
        Self {
            entries: Vec::new(),
            most: 1e4 * violation.max(1.0),
            small: 1e-4 * violation.max(1.0),
        }
    }

    /// Whether the filter has no entries.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Removes all entries.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
    }

    /// Whether a trial point is acceptable from the present point. Adds the present point to the filter unless the step is a
    /// descent of the merit.
    pub(super) fn takes(&mut self, now: Measure, trial: Measure, length: f64, slope: f64) -> bool {
        if !self.admits(trial) {
            return false;
        }
        let decrease = now.merit - trial.merit + rounding(now.merit);
        let descent = slope < 0.0 && length * (-slope).powf(2.3) > now.violation.powf(1.1);
        if descent && now.violation <= self.small {
            return decrease >= -SUFFICIENT * length * slope;
        }
        let better = trial.violation <= (1.0 - VIOLATION_MARGIN) * now.violation
            || decrease >= MERIT_MARGIN * now.violation;
        if better {
            self.leave(now);
        }
        better
    }

    /// Adds a point to the filter, with its margins.
    pub(super) fn leave(&mut self, point: Measure) {
        self.entries.push(Measure {
            violation: (1.0 - VIOLATION_MARGIN) * point.violation,
            merit: point.merit - MERIT_MARGIN * point.violation,
        });
    }

    /// Whether no entry dominates a point.
    pub(super) fn admits(&self, point: Measure) -> bool {
        let dominated = |entry: &Measure| {
            point.violation >= entry.violation && point.merit >= entry.merit + rounding(entry.merit)
        };
        point.merit.is_finite()
            && point.violation <= self.most
            && !self.entries.iter().any(dominated)
    }
}

/// Difference of merits that is rounding.
fn rounding(merit: f64) -> f64 {
    10.0 * f64::EPSILON * merit.abs()
}
