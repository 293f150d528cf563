//! Templates: text in which `@NAME@` stands for a value.

/// Placeholders, with the values that take their places.
pub(super) type Values = Vec<(&'static str, String)>;

/// The text with every `@NAME@` replaced by its value, in the order of the values: a value may have placeholders of later ones.
pub(super) fn fill(text: &str, values: &Values) -> String {
    values.iter().fold(text.to_owned(), |text, (name, value)| text.replace(&format!("@{name}@"), value))
}
