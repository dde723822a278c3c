//! Input and output: scenarios as TOML and JSON, results as JSON, numbers of a scenario by the names of their fields, stored
//! results.
//!
//! This room and the crates that it needs are built with the feature `io`.

mod path;
pub mod result;
pub mod scenario;
pub mod stored;

#[cfg(test)]
mod tests {
    use crate::analysis::continuation::{End, Kind};
    use crate::analysis::path::Motion;
    use crate::equilibrium::Status;
    use crate::names::Named;
    use crate::scenario::{Axis, EnergyModel, Method};
    use serde::Serialize;

    /// Checks that all names differ, and that serde writes each name.
    fn check<T: Named + Serialize>(all: &[T]) {
        let names: Vec<_> = all.iter().map(T::name).collect();
        assert_eq!(names, T::names());
        let written = serde_json::to_value(all).unwrap();
        assert_eq!(written, serde_json::to_value(&names).unwrap());
        let mut apart = names.clone();
        apart.sort_unstable();
        apart.dedup();
        assert_eq!(apart.len(), names.len());
    }

    #[test]
    fn serde_writes_the_names() {
        check(Status::ALL);
        check(EnergyModel::ALL);
        check(Method::ALL);
        check(Axis::ALL);
        check(Motion::ALL);
        check(Kind::ALL);
        check(End::ALL);
    }
}
