//! Tests of the crate without Python; one module per subject.

mod active;
mod at_mean;
mod basis;
mod border;
mod cam_clay;
mod hencky;
mod linear_elastic;
mod location;
mod mohr_coulomb;
mod near;
mod neo_hookean;
mod plasticity;
mod space;
mod stage;
mod storage;
mod transfer;
