//! The valid key that a misspelt one most likely means.

/// "did you mean …" where one of `valid` is near, else all of them.
pub(super) fn hint(given: &str, valid: &[&str]) -> String {
    // A third of the letters may be wrong; a whole word with its unit missing counts as one.
    let limit = (given.chars().count() / 3).max(2);
    let distance = |key: &str| match key.strip_prefix(given) {
        Some(rest) if rest.starts_with('_') => 1,
        _ => edit_distance(given, key),
    };
    match valid.iter().min_by_key(|key| distance(key)) {
        Some(key) if distance(key) <= limit => format!("did you mean `{key}`?"),
        _ => {
            let keys: Vec<String> = valid.iter().map(|key| format!("`{key}`")).collect();
            format!("valid keys here are {}", keys.join(", "))
        }
    }
}

/// Insertions, deletions, substitutions and swaps of neighbours from one word to the other
/// (optimal string alignment). Cost: O(length²).
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut before = vec![0; b.len() + 1];
    let mut above: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let substituted = above[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = substituted.min(above[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_count_edits() {
        let cases =
            [("", "abc", 3), ("abc", "abc", 0), ("kitten", "sitting", 3), ("stesp", "steps", 1)];
        for (a, b, want) in cases {
            assert_eq!((edit_distance(a, b), edit_distance(b, a)), (want, want), "{a} {b}");
        }
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
