//! The filter of the line search: which pairs of violation and merit have been left behind for good.

/// What a point is judged by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measure {
    /// 1-norm of the constraint violation.
    pub(super) violation: f64,
    /// Barrier function.
    pub(super) merit: f64,
}

/// Measures that no later point may be dominated by.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    entries: Vec<Measure>,
    most: f64,
    small: f64,
}

const VIOLATION_MARGIN: f64 = 1e-5;
const MERIT_MARGIN: f64 = 1e-5;
const SUFFICIENT: f64 = 1e-4;

impl Filter {
    /// A filter for a minimisation that starts with this violation.
    pub(super) fn new(violation: f64) -> Self {
        Self {
            entries: Vec::new(),
            most: 1e4 * violation.max(1.0),
            small: 1e-4 * violation.max(1.0),
        }
    }

    /// Whether nothing is remembered.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Forgets all entries.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
    }

    /// Whether a trial point improves on the present one; remembers the present one where it is left for the sake of
    /// the constraints.
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

    /// Remembers a point that is left for the sake of the constraints.
    pub(super) fn leave(&mut self, point: Measure) {
        self.entries.push(Measure {
            violation: (1.0 - VIOLATION_MARGIN) * point.violation,
            merit: point.merit - MERIT_MARGIN * point.violation,
        });
    }

    /// Whether no remembered point dominates this one.
    pub(super) fn admits(&self, point: Measure) -> bool {
        let dominated = |entry: &Measure| {
            point.violation >= entry.violation && point.merit >= entry.merit + rounding(entry.merit)
        };
        point.merit.is_finite()
            && point.violation <= self.most
            && !self.entries.iter().any(dominated)
    }
}

/// Differences of the merit below this are rounding.
fn rounding(merit: f64) -> f64 {
    10.0 * f64::EPSILON * merit.abs()
}
