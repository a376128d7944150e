//! The list of frames over time that ParaView opens.

use std::fmt::Write;

/// The text of a ParaView collection of `(time, file)`, files relative to it. Times in s.
pub(super) fn collection(frames: &[(f64, String)]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n",
    );
    for (time_s, file) in frames {
        // Writing to a String can't fail.
        let _ = writeln!(text, "    <DataSet timestep=\"{time_s:?}\" part=\"0\" file=\"{file}\"/>");
    }
    text.push_str("  </Collection>\n</VTKFile>\n");
    text
}
