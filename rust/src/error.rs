//! The errors of the core: each names the object and the remedy, and becomes a Python class of its own at the border.
use thiserror::Error;

/// What can fail. Messages name the object and the remedy.
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
    Convergence {
        /// what did not converge
        message: String,
        /// what it reached
        best: Vec<f64>,
        /// and how far that is from a solution
        residual: f64,
    },
    /// A derivative that does not exist.
    #[error("{0}")]
    NotDifferentiable(String),
    /// The user pressed Ctrl-C.
    #[error("interrupted")]
    Interrupted,
}

/// Of everything that can fail.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A model that is wrong.
    pub fn model(message: impl Into<String>) -> Self {
        Error::Model(message.into())
    }

    /// A route that does not support something.
    pub fn route(message: impl Into<String>) -> Self {
        Error::Route(message.into())
    }

    /// A matrix that is singular.
    pub fn singular(message: impl Into<String>) -> Self {
        Error::Singular(message.into())
    }
}
