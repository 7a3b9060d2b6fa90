//! The whole way from human frames to joint targets, judged from outside.

mod adversarial;
mod dance;
mod defects;
mod descriptions;
mod latecomers;
mod random_rigs;
mod stepping;
mod support;
