//! The valid key that a misspelt one most likely means.

/// "did you mean …" where one of `valid` is near, else all of them.
pub(super) fn hint(given: &str, valid: &[&str]) -> String {
    // A third of the letters may be wrong; a whole word with its unit missing counts as one.
    let limit = (given.chars().count() / 3).max(2);
    let distance = |key: &str| match key.strip_prefix(given) {
        Some(rest) if rest.starts_with('_') => 1,
        _ => strsim::osa_distance(given, key),
    };
    match valid.iter().min_by_key(|key| distance(key)) {
        Some(key) if distance(key) <= limit => format!("did you mean `{key}`?"),
        _ => {
            let keys: Vec<String> = valid.iter().map(|key| format!("`{key}`")).collect();
            format!("valid keys here are {}", keys.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn swapped_letters_count_once() {
        assert_eq!(hint("stesp", &["steps", "name"]), "did you mean `steps`?");
    }

    #[test]
    fn far_words_get_the_whole_list() {
        assert_eq!(hint("base", &["base_mm", "max_level"]), "did you mean `base_mm`?");
        assert_eq!(
            hint("colour", &["base_mm", "max_level"]),
            "valid keys here are `base_mm`, `max_level`"
        );
    }
}
