//! The list of frames over time that ParaView opens.

use std::fmt::Write;

/// The text of a ParaView collection of `(time, files)`, files relative to it; the files of one
/// time are its parts 0, 1, … Times in s.
pub(super) fn collection(frames: &[(f64, Vec<String>)]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n",
    );
    for (time_s, files) in frames {
        for (part, file) in files.iter().enumerate() {
            // Writing to a String can't fail.
            let _ = writeln!(
                text,
                "    <DataSet timestep=\"{time_s:?}\" part=\"{part}\" file=\"{file}\"/>"
            );
        }
    }
    text.push_str("  </Collection>\n</VTKFile>\n");
    text
}
