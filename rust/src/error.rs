//! The errors of the core: each names the object and the remedy, and becomes a Python class of its own at the border.
use thiserror::Error;

#[derive(Debug, Clone, Error)]
pub enum Error {
    /// The model itself is wrong: shapes, values, names.
    #[error("{0}")]
    Model(String),
    /// A route that does not know something in the model, which another one does.
    #[error("{0}")]
    Route(String),
    /// Constraints that contradict each other, or loops that cannot close.
    #[error("{0}")]
    Assembly(String),
    /// A matrix that had to be regular is singular.
    #[error("{0}")]
    Singular(String),
    /// An iteration gave up; what it reached travels beside the message.
    #[error("{message}")]
    Convergence { message: String, best: Vec<f64>, residual: f64 },
    /// A derivative that does not exist.
    #[error("{0}")]
    NotDifferentiable(String),
    /// The user pressed Ctrl-C.
    #[error("interrupted")]
    Interrupted,
}

pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    pub fn model(message: impl Into<String>) -> Self {
        Error::Model(message.into())
    }

    pub fn route(message: impl Into<String>) -> Self {
        Error::Route(message.into())
    }

    pub fn singular(message: impl Into<String>) -> Self {
        Error::Singular(message.into())
    }
}
