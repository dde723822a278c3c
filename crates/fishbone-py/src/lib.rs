//! Python bindings: convert, release the GIL, call.

mod array;
mod batch;
mod branches;
mod equilibrium;
mod errors;
mod exclusive;
mod follow;
mod names;
mod pose;
mod scenario;
mod sensitivity;
mod signals;
mod solve;
mod stored;
mod threads;
mod tracker;

/// The compiled core of fishbone; `fishbone` itself is its public face.
#[pyo3::pymodule]
mod _core {
    use pyo3::prelude::*;

    /// NumPy's functions are found here: at the first array this would run Python code, and with it handlers of signals.
    #[pymodule_init]
    fn find_numpy(module: &Bound<'_, PyModule>) -> PyResult<()> {
        numpy::dtype::<f64>(module.py());
        Ok(())
    }

    #[pymodule_export]
    use crate::batch::solve_many;
    #[pymodule_export]
    use crate::branches::branches;
    #[pymodule_export]
    use crate::equilibrium::Equilibrium;
    #[pymodule_export]
    use crate::follow::{Diagram, Path, follow};
    #[pymodule_export]
    use crate::names::names;
    #[pymodule_export]
    use crate::pose::{rotation_of_matrix, rotation_of_quaternion};
    #[pymodule_export]
    use crate::scenario::Scenario;
    #[pymodule_export]
    use crate::sensitivity::Sensitivity;
    #[pymodule_export]
    use crate::solve::{solve, solve_from};
    #[pymodule_export]
    use crate::tracker::Tracker;

    /// Version of the package, a word.
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name Python expects")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
