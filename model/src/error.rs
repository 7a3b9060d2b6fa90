//! What can go wrong with the networks: at load (the weights file) and in a
//! step (numbers that are not finite). Nothing here panics on bad files.

use thiserror::Error;

/// An error of the motion networks. `source_name` is the path of a weights file, or
/// "built-in weights"; shapes are in the order of the file.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are what the message says")]
pub enum ModelError {
    /// The weights file cannot be read at all.
    #[error("{source_name}: {reason}")]
    File { source_name: String, reason: String },
    /// The file's configuration is missing or makes no sense.
    #[error("{source_name}: configuration: {reason}")]
    Config { source_name: String, reason: String },
    /// A tensor that the configuration asks for is not in the file.
    #[error("{source_name}: tensor `{tensor}` is missing (expected shape {expected:?})")]
    MissingTensor { source_name: String, tensor: String, expected: Vec<usize> },
    /// A tensor has another shape than the configuration asks for.
    #[error("{source_name}: tensor `{tensor}` has shape {found:?}, expected {expected:?}")]
    Shape { source_name: String, tensor: String, expected: Vec<usize>, found: Vec<usize> },
    /// A tensor has a number format that is not read here.
    #[error("{source_name}: tensor `{tensor}` has type {found}, expected {expected}")]
    Type { source_name: String, tensor: String, expected: &'static str, found: String },
    /// A motion that no figure can be made of.
    #[error("the motion has {found} frames, at least {expected} are needed")]
    TooShort { found: usize, expected: usize },
    #[error("{source_name}: tensor `{tensor}` holds a number that is not finite, at index {index}")]
    NotFinite { source_name: String, tensor: String, index: usize },
    #[error("unknown style `{found}`; choose one of: {}", known.join(", "))]
    UnknownStyle { found: String, known: Vec<String> },
    /// The weights were trained on music features of another kind.
    #[error("the weights hear {wanted} music features, but {fed} are fed")]
    MusicKind { wanted: &'static str, fed: &'static str },
    /// The weights take no style vector like this one.
    #[error("the weights take styles of {expected} finite numbers, not of {found}")]
    StyleWidth { found: usize, expected: usize },
    /// A generator option is out of its range.
    #[error("option `{option}` is {found}, expected {expected}")]
    Option { option: &'static str, found: String, expected: &'static str },
    /// The networks gave a number that is not finite; start a new dance.
    #[error("the model's output at frame {frame} is not finite; start again")]
    Diverged { frame: u64 },
    /// The model says that the dance is over, and was asked to stop there.
    #[error("the model ends the dance at frame {frame}")]
    Ended { frame: u64 },
    /// What computes on tensors is not part of this build.
    #[error("{what} is not built in; build with --features train")]
    NotBuiltIn { what: &'static str },
    #[cfg(feature = "candle")]
    #[error("tensor operation: {0}")]
    Tensor(#[from] candle_core::Error),
}
