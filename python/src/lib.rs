//! The native half of the Python package `servodance`: arrays in, arrays out, the
//! interpreter's lock released while there is work. The Python half
//! (`python/servodance/__init__.py`) checks and converts arguments and holds the documentation.

mod bus;
mod dance;
mod music;
mod robot;

use numpy::PyArray2;
use numpy::ndarray::Array2;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::sync::Mutex;

pyo3::create_exception!(servodance, Error, PyException, "What the command line would say.");

/// The message of an error with all its causes, as the command line prints it.
fn error(error: impl Into<anyhow::Error>) -> PyErr {
    Error::new_err(format!("{:#}", error.into()))
}

/// What a stream holds, unless a call on it ended in a panic.
fn unpoisoned<T>(held: &mut Mutex<T>) -> PyResult<&mut T> {
    held.get_mut().map_err(|_| error(anyhow::anyhow!("an earlier call on this stream failed")))
}

/// Rows of equal width as a numpy array [rows, width].
fn table<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let rows = values.len() / width.max(1);
    let array = Array2::from_shape_vec((rows, width), values);
    Ok(PyArray2::from_owned_array(py, array.map_err(error)?))
}

#[pymodule]
fn _servodance(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("Error", module.py().get_type::<Error>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<music::MusicStream>()?;
    module.add_class::<dance::DanceStream>()?;
    module.add_class::<robot::Robot>()?;
    module.add_class::<robot::RetargetStream>()?;
    module.add_class::<bus::SimBus>()?;
    module.add_function(wrap_pyfunction!(music::beats, module)?)?;
    module.add_function(wrap_pyfunction!(dance::styles, module)?)?;
    module.add_function(wrap_pyfunction!(dance::generate, module)?)?;
    module.add_function(wrap_pyfunction!(robot::retarget, module)?)?;
    module.add_function(wrap_pyfunction!(robot::built_in_robots, module)?)
}
