//! Aerodynamics: velocities that vortex filaments induce, and the force of the air on the sections of blades.
pub mod annulus;
pub mod filaments;
mod kernels;
pub mod polar;
pub mod section;
pub mod unsteady;

#[cfg(test)]
mod tests;
