//! One binary, themed modules: the program as its users run it.

#[cfg(feature = "train")]
mod ablation;
mod bad_input;
mod beats;
mod bus_tools;
mod can_robot;
mod command_line;
#[cfg(feature = "train")]
mod conditioning;
mod configuration;
mod crash_safety;
#[cfg(feature = "train")]
mod dataset;
mod documents;
mod endurance;
#[cfg(feature = "train")]
mod evaluation;
mod film;
mod full_disk;
mod host_stall;
mod idle;
mod kinds;
mod live;
mod look_alikes;
mod look_alikes_by_name;
mod look_alikes_by_shape;
mod motion_files;
mod mutate;
mod on_beat;
mod on_its_feet;
mod overload;
mod program;
mod random_robot;
mod recording;
mod repeatable;
mod retarget_motion;
mod rigs;
mod robot_check;
mod robot_folder;
mod robot_mutations;
mod robot_new;
mod robot_setup;
mod servo_memory;
mod show;
mod stage;
mod start_frame;
mod terminal;
mod torque_off;
#[cfg(feature = "train")]
mod training;
#[cfg(not(feature = "train"))]
mod untrained;
#[cfg(feature = "train")]
mod weights;
