//! Values by the area on which they are exceeded.

/// The values over a board by the area on which they are exceeded: linear in it between the points of a fine grid.
#[derive(Debug, Clone)]
pub(in crate::surface) struct Shares {
    /// Falling values, each with the area on which it is exceeded: half of its own point's area is part of it.
    points: Vec<[f64; 2]>,
    /// Area of all points.
    total: f64,
}

impl Shares {
    /// Of points with a value and an area each.
    pub(super) fn of(mut points: Vec<[f64; 2]>) -> Self {
        points.sort_unstable_by(|a, b| b[0].total_cmp(&a[0]));
        let mut total = 0.0;
        for [_, area] in &mut points {
            let own = *area;
            *area = total + 0.5 * own;
            total += own;
        }
        Self { points, total }
    }

    /// The value exceeded on an area; 0 on more than all points have.
    pub(super) fn exceeded_on(&self, area: f64) -> f64 {
        let next = self.points.partition_point(|point| point[1] < area);
        match (next.checked_sub(1), self.points.get(next)) {
            (None, Some([value, _])) => *value,
            (Some(last), Some([low, to])) => {
                let [high, from] = self.points[last];
                high + (low - high) * (area - from) / (to - from)
            }
            (_, None) => 0.0,
        }
    }

    /// The area on which a value is exceeded.
    pub(in crate::surface) fn area_above(&self, value: f64) -> f64 {
        let next = self.points.partition_point(|point| point[0] >= value);
        match (next.checked_sub(1), self.points.get(next)) {
            (None, _) => 0.0,
            (Some(last), Some([low, to])) => {
                let [high, from] = self.points[last];
                from + (to - from) * (high - value) / (high - low)
            }
            (_, None) => self.total,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn test_values_of_equal_areas_are_linear_in_the_area() {
        let shares = Shares::of((0..100).map(|i| [f64::from(i), 0.5]).collect());
        let found = [0.25, 1.0, 20.0, 51.0].map(|area| shares.exceeded_on(area));
        assert_relative_eq!(found[0], 99.0);
        assert_relative_eq!(found[1], 97.5);
        assert_relative_eq!(found[2], 59.5);
        assert_eq!(found[3], 0.0);
        for (value, area) in found.into_iter().zip([0.25, 1.0, 20.0]) {
            assert_relative_eq!(shares.area_above(value), area);
        }
        assert_eq!(
            [99.5, -0.5].map(|value| shares.area_above(value)),
            [0.0, 50.0]
        );
    }
}
