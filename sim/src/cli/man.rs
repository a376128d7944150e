//! `yawara man`: manual pages, from the arguments themselves.

use std::fs;

use crate::SimError;
use clap::CommandFactory;
use clap_mangen::Man;

use super::arguments::{Arguments, ManArguments};
use super::printer::Printer;

pub fn run(arguments: &ManArguments, out: &mut Printer) -> Result<(), SimError> {
    let command = Arguments::command();
    if let Some(folder) = &arguments.folder {
        return fs::create_dir_all(folder)
            .and_then(|()| clap_mangen::generate_to(command, folder))
            .map_err(|error| SimError::Io(folder.clone(), error));
    }
    let mut page = Vec::new();
    Man::new(command).render(&mut page).map_err(|error| SimError::Io("<stdout>".into(), error))?;
    out.print(&String::from_utf8_lossy(&page))
}
