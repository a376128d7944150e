//! `yawara view`: a scene in the browser, with hands on it.

use crate::SimError;
use crate::view::{ViewOptions, serve};

use super::arguments::ViewArguments;
use super::printer::Printer;

/// Serves the page until the process is interrupted.
pub fn run(arguments: &ViewArguments, out: &mut Printer) -> Result<(), SimError> {
    let program = std::env::current_exe().map_err(|error| SimError::Io("yawara".into(), error))?;
    let options = ViewOptions {
        scene: arguments.scene.clone(),
        set: arguments.set.clone(),
        beside: arguments.beside.clone(),
        grey: arguments.grey.clone(),
        listen: arguments.listen,
        port: arguments.port,
        play: arguments.play,
        keep_going: arguments.keep_going,
        out: arguments.out.clone(),
        program,
    };
    let end = async {
        // Where the system has no such signal, the page is served until the process is ended.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    serve(options, end, |listening| out.print(&format!("{}\n", listening.url)))
}
