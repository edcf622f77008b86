//! Aerodynamics: velocities that vortex filaments induce.
pub mod filaments;
mod kernels;

#[cfg(test)]
mod tests;
