//! One binary, themed modules: the program as its users run it.

mod bad_input;
mod bus_tools;
mod documents;
mod program;
mod recording;
mod repeatable;
mod torque_off;
