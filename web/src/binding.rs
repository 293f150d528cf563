//! The playground as JavaScript sees it.

use serde_json::{Value, json};
use wasm_bindgen::prelude::wasm_bindgen;

/// A playground in a browser.
#[wasm_bindgen]
#[derive(Default)]
pub struct Playground(crate::Playground);

#[wasm_bindgen]
impl Playground {
    /// An empty one.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Playground {
        Playground::default()
    }

    /// Answers a request: `{"ok": …}`, or `{"error": "…"}`.
    pub fn call(&mut self, method: &str, params: &str) -> String {
        let params = serde_json::from_str(params).unwrap_or(Value::Null);
        match self.0.call(method, params) {
            Ok(answer) => json!({ "ok": answer }),
            Err(error) => json!({ "error": error }),
        }
        .to_string()
    }

    /// The image of the program; empty if there is none.
    pub fn image(&self) -> Vec<u8> {
        self.0.image().unwrap_or_default()
    }
}
