//! Systems that depend on the continuation parameter: any number of a model, changed by whoever made it.
use std::sync::Arc;

use super::element::Element;
use super::linear::DynamicStiffness;
use crate::error::Result;

/// The system at one value of the parameter.
pub struct Member {
    pub linear: Box<dyn DynamicStiffness>,
    pub elements: Vec<Element>,
}

/// Makes the system anew for every value; coordinates, retained ones and elements keep their number and order.
pub trait Family: Send + Sync {
    fn member(&self, value: f64) -> Result<Member>;
}

/// A family with the value that is in use and the step of differences by the parameter.
#[derive(Clone)]
pub struct Placed {
    pub family: Arc<dyn Family>,
    pub value: f64,
    pub step: f64,
}
