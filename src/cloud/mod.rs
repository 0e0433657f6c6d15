//! Real point clouds -> sweeps that the cells stage can bin; labelled clouds and cost maps back.
