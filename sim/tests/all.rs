//! All tests of the crate but those of its features, the page, the heap and the clock, in one program: it is linked once, and a long test of
//! one file runs beside those of another.

mod batches;
mod builder;
mod built_in_scenes;
mod by_hand;
mod command_line;
mod contact;
mod cut_surfaces;
mod cutting;
mod dynamics;
mod easing;
mod energy;
mod estimate;
mod first_hour;
mod following;
mod hands;
mod homogenisation;
mod idle_tools;
mod images;
mod init;
mod left_out;
mod library;
mod liver_scene;
mod memory;
mod mesh_files;
mod passivity;
mod physics;
mod places;
mod preview;
mod resection;
mod resume;
mod shell;
mod surfaces;
mod tool_stiffness;
mod topology;
mod workbench;
