//! Simulated servos that other programs open as a serial port.

use crate::error;
use crate::robot::Robot;
use pyo3::prelude::*;
use servodance_runtime::bus_tools::serve::{self, SimBusOptions};
use servodance_runtime::bus_tools::sim_link::LinkChoice;
use servodance_runtime::world::WorldChoice;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::JoinHandle;

/// A robot's servos, served by a thread until [`SimBus::stop`].
#[pyclass]
pub struct SimBus {
    ports: Vec<String>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<anyhow::Result<String>>>,
}

#[pymethods]
impl SimBus {
    #[new]
    fn new(
        py: Python<'_>,
        robot: &Robot,
        link: Option<&str>,
        world: &str,
        faults: String,
        backlash: bool,
    ) -> PyResult<Self> {
        let link = link.map(choice::<LinkChoice>).transpose()?;
        let world = choice::<WorldChoice>(world)?;
        let robot = robot.robot.clone();
        let buses = robot.buses.len();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let (tell, told) = mpsc::channel();
        let serve = move || {
            let options =
                SimBusOptions { link, faults: &faults, backlash, world, ..Default::default() };
            serve::serve(&robot, options, &stopped, |port| {
                let _ = tell.send(port.to_owned()); // nobody listens after `new`
            })
        };
        let thread = std::thread::Builder::new().name("sim-bus".into()).spawn(serve)?;
        let ports: Vec<String> = py.detach(move || told.iter().take(buses).collect());
        let mut bus = Self { ports, stop, thread: Some(thread) };
        if bus.ports.len() < buses {
            bus.stop(py)?;
        }
        Ok(bus)
    }

    #[getter]
    fn ports(&self) -> Vec<String> {
        self.ports.clone()
    }

    /// Ends the servos; what was seen, the first time.
    fn stop(&mut self, py: Python<'_>) -> PyResult<Option<String>> {
        self.stop.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else {
            return Ok(None);
        };
        let ended = py.detach(|| thread.join());
        let ended = ended.map_err(|_| error(anyhow::anyhow!("the simulated bus failed")))?;
        ended.map(Some).map_err(error)
    }
}

impl Drop for SimBus {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
    }
}

fn choice<T: clap::ValueEnum>(name: &str) -> PyResult<T> {
    T::from_str(name, false).map_err(|_| {
        let all = T::value_variants().iter().filter_map(T::to_possible_value);
        let names: Vec<String> = all.map(|value| value.get_name().to_owned()).collect();
        error(anyhow::anyhow!("\"{name}\" is none of {}", names.join(", ")))
    })
}
