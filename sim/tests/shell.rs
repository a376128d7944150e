//! Completions and manual pages name the commands that there are.

use crate::workbench;

use workbench::Workbench;

/// The commands that `yawara --help` lists, without itself.
fn commands(bench: &Workbench) -> Vec<String> {
    let help = bench.succeed(&["--help"]);
    let list = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let is_name = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let names = list.lines().filter(is_name).filter_map(|line| line.split_whitespace().next());
    let names: Vec<String> = names.filter(|&name| name != "help").map(String::from).collect();
    assert!(names.len() >= 12 && names.contains(&"run".into()), "{names:?}");
    names
}

#[test]
fn every_shell_completes_every_command() {
    let bench = Workbench::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = bench.succeed(&["completions", shell]);
        for command in commands(&bench) {
            assert!(script.contains(&command), "{shell} lacks {command}");
        }
        assert!(script.contains("steps"), "{shell} lacks --steps");
    }
    bench.refused(&["completions", "tcsh"], &["tcsh", "bash", "fish"]);
}

#[test]
fn the_manual_has_every_command() {
    let bench = Workbench::new();
    let page = bench.succeed(&["man"]);
    assert!(page.contains(".TH yawara 1"), "{page}");
    bench.succeed(&["man", "pages"]);
    for command in commands(&bench) {
        assert!(page.contains(&format!("yawara\\-{command}(1)")), "no {command} in {page}");
        assert!(bench.read(&format!("pages/yawara-{command}.1")).contains(".SH NAME"));
    }
    assert!(bench.read("pages/yawara-run.1").contains("\\-\\-steps"));
    bench.write("file", "");
    bench.refused(&["man", "file"], &["file"]);
}
