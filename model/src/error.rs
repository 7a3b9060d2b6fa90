//! What can go wrong with the networks: at load (the weights file) and in a
//! step (numbers that are not finite). Nothing here panics on bad files.

use thiserror::Error;

/// An error of the motion networks.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The weights file cannot be read at all.
    #[error("{source_name}: {reason}")]
    File {
        /// Path of the file, or "built-in weights".
        source_name: String,
        /// What the reader said.
        reason: String,
    },
    /// The file's configuration is missing or makes no sense.
    #[error("{source_name}: configuration: {reason}")]
    Config {
        /// Path of the file, or "built-in weights".
        source_name: String,
        /// Which field, what is wrong.
        reason: String,
    },
    /// A tensor that the configuration asks for is not in the file.
    #[error("{source_name}: tensor `{tensor}` is missing (expected shape {expected:?})")]
    MissingTensor {
        /// Path of the file, or "built-in weights".
        source_name: String,
        /// The tensor's name.
        tensor: String,
        /// The shape that the configuration asks for.
        expected: Vec<usize>,
    },
    /// A tensor has another shape than the configuration asks for.
    #[error("{source_name}: tensor `{tensor}` has shape {found:?}, expected {expected:?}")]
    Shape {
        /// Path of the file, or "built-in weights".
        source_name: String,
        /// The tensor's name.
        tensor: String,
        /// The shape that the configuration asks for.
        expected: Vec<usize>,
        /// The shape in the file.
        found: Vec<usize>,
    },
    /// A tensor has a number format that is not read here.
    #[error("{source_name}: tensor `{tensor}` has type {found}, expected {expected}")]
    Type {
        /// Path of the file, or "built-in weights".
        source_name: String,
        /// The tensor's name.
        tensor: String,
        /// What is accepted.
        expected: &'static str,
        /// The type in the file.
        found: String,
    },
    /// A motion that no figure can be made of.
    #[error("the motion has {found} frames, at least {expected} are needed")]
    TooShort {
        /// Its frames.
        found: usize,
        /// The fewest.
        expected: usize,
    },
    /// A weight is NaN or infinite.
    #[error("{source_name}: tensor `{tensor}` holds a number that is not finite, at index {index}")]
    NotFinite {
        /// Path of the file, or "built-in weights".
        source_name: String,
        /// The tensor's name.
        tensor: String,
        /// Index in the flattened tensor.
        index: usize,
    },
    /// No style has this name.
    #[error("unknown style `{found}`; choose one of: {}", known.join(", "))]
    UnknownStyle {
        /// The name asked for.
        found: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// The weights were trained on music features of another kind.
    #[error("the weights hear {wanted} music features, but {fed} are fed")]
    MusicKind {
        /// What the weights say.
        wanted: &'static str,
        /// What was listened for.
        fed: &'static str,
    },
    /// The weights take no style vector like this one.
    #[error("the weights take styles of {expected} finite numbers, not of {found}")]
    StyleWidth {
        /// Numbers of the vector.
        found: usize,
        /// The weights' `style_dim`.
        expected: usize,
    },
    /// A generator option is out of its range.
    #[error("option `{option}` is {found}, expected {expected}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Its value.
        found: String,
        /// The range.
        expected: &'static str,
    },
    /// The networks gave a number that is not finite; start a new dance.
    #[error("the model's output at frame {frame} is not finite; start again")]
    Diverged {
        /// Frames since the start.
        frame: u64,
    },
    /// The model says that the dance is over, and was asked to stop there.
    #[error("the model ends the dance at frame {frame}")]
    Ended {
        /// Frames since the start.
        frame: u64,
    },
    /// The tensor library refused an operation.
    #[error("tensor operation: {0}")]
    Tensor(#[from] candle_core::Error),
}
