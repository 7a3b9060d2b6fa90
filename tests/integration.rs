//! One binary, themed modules: the program as its users run it.

mod bad_input;
mod beats;
mod bus_tools;
mod can_robot;
mod command_line;
mod dataset;
mod documents;
mod evaluation;
mod full_disk;
mod idle;
mod live;
mod motion_files;
mod mutate;
mod on_beat;
mod program;
mod random_robot;
mod recording;
mod repeatable;
mod retarget_motion;
mod rigs;
mod robot_check;
mod robot_mutations;
mod robot_new;
mod show;
mod torque_off;
