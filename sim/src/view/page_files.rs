//! The files of the page, and the page as one file.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// The page itself.
pub(super) const INDEX: &str = include_str!("page/index.html");

const STYLE: &str = include_str!("page/page.css");

/// Path, kind and content of what it refers to; the modules after the first three.
pub(super) const FILES: [(&str, &str, &str); 11] = [
    ("/page.css", "text/css", STYLE),
    ("/icon.svg", "image/svg+xml", include_str!("page/icon.svg")),
    ("/main.js", "text/javascript", MAIN),
    ("/body.js", "text/javascript", include_str!("page/body.js")),
    ("/clock.js", "text/javascript", include_str!("page/clock.js")),
    ("/colour.js", "text/javascript", include_str!("page/colour.js")),
    ("/cut.js", "text/javascript", include_str!("page/cut.js")),
    ("/picture.js", "text/javascript", include_str!("page/picture.js")),
    ("/plot.js", "text/javascript", include_str!("page/plot.js")),
    ("/source.js", "text/javascript", include_str!("page/source.js")),
    ("/three.js", "text/javascript", include_str!("page/three.js")),
];

const MAIN: &str = include_str!("page/main.js");

/// What a page that stands alone may load: what is in it.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; \
    img-src data: blob:; base-uri 'none'; form-action 'none'";

/// The page in one file, with `recording` (JSON) in it: nothing is loaded from elsewhere.
///
/// Modules can't be loaded from files, but from addresses that hold them, by names that a map gives them.
pub(super) fn alone(recording: &str) -> String {
    let modules = FILES.iter().skip(3).map(|(path, kind, text)| {
        let address = format!("data:{kind};base64,{}", STANDARD.encode(by_name(text)));
        (path[1..].to_owned(), serde_json::Value::from(address))
    });
    let map = serde_json::json!({ "imports": serde_json::Map::from_iter(modules) });
    // In a script no text may look like the end of it.
    let recording = recording.replace('<', r"\u003c");
    let main = by_name(MAIN);
    let head = format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n<style>\n{STYLE}</style>\n\
         <script type=\"importmap\">{map}</script>\n\
         <script type=\"application/json\" id=\"recording\">{recording}</script>\n"
    );
    let script = format!("<script type=\"module\">\n{main}</script>\n");
    let lines = INDEX.split_inclusive('\n').map(|line| match line.trim_end() {
        r#"<link rel="icon" href="icon.svg" type="image/svg+xml">"# => "",
        r#"<link rel="stylesheet" href="page.css">"# => &head,
        r#"<script type="module" src="main.js"></script>"# => &script,
        _ => line,
    });
    lines.collect()
}

/// A module whose imports are by name in place of path.
fn by_name(module: &str) -> String {
    module.replace("from './", "from '")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_alone_refers_to_nothing_and_holds_what_it_is_given() {
        let page = alone(r#"{"text":"</script>"}"#);
        assert!(!page.contains("href=") && !page.contains("src=") && !page.contains("from './"));
        assert!(page.contains(r#"{"text":"\u003c/script>"}"#));
        assert_eq!(page.matches("</script>").count(), 3);
    }
}
