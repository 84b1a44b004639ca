//! Where two sets of parameters differ, by the names of their fields.

use std::fmt;

use bristle_core::drive::Parameters;
use serde::Serialize;
use serde_json::Value;

use crate::error::{Error, Result};

/// A field in which two sets differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Its path, as in `control.friction.coulomb`.
    pub field: String,
    /// What was sent.
    pub sent: Value,
    /// What the board holds.
    pub found: Value,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (found, sent) = (single(&self.found), single(&self.sent));
        write!(f, "{}: {found} and not {sent}", self.field)
    }
}

/// A number as short as single precision allows; JSON has widened it.
fn single(value: &Value) -> String {
    match value.as_f64() {
        Some(x) if value.is_f64() => (x as f32).to_string(),
        _ => value.to_string(),
    }
}

/// The fields in which what a board holds differs from what it was sent; none if they are the same.
///
/// Numbers travel as their bits, so any difference is one.
pub fn differences(sent: &Parameters<f32>, found: &Parameters<f32>) -> Result<Vec<Difference>> {
    let value = |p| serde_json::to_value(p).map_err(|e| Error::Internal(format!("{e}")));
    let mut all = Vec::new();
    walk(String::new(), &value(sent)?, &value(found)?, &mut all);
    if all.is_empty() && sent != found {
        return Err(Error::Internal(
            "two sets of parameters differ in no field".to_owned(),
        ));
    }
    Ok(all)
}

fn walk(path: String, sent: &Value, found: &Value, all: &mut Vec<Difference>) {
    let below = |key: &str| {
        let dot = if path.is_empty() { "" } else { "." };
        format!("{path}{dot}{key}")
    };
    match (sent, found) {
        (Value::Object(a), Value::Object(b)) => {
            for (key, value) in a {
                walk(below(key), value, b.get(key).unwrap_or(&Value::Null), all);
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            for (k, value) in a.iter().enumerate() {
                let other = b.get(k).unwrap_or(&Value::Null);
                walk(below(&(k + 1).to_string()), value, other, all);
            }
        }
        _ if sent == found => {}
        _ => all.push(Difference {
            field: path,
            sent: sent.clone(),
            found: found.clone(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use bristle_core::drive::Parameters;

    use super::differences;

    #[test]
    fn every_changed_field_is_named_and_no_other() {
        let sent = Parameters::<f32>::harmless();
        assert_eq!(differences(&sent, &sent).unwrap(), []);
        let mut found = sent;
        found.limits.jump += 1;
        found.control.friction.coulomb += f32::EPSILON;
        found.control.effects.waves[2].sine = 0.5;
        let all = differences(&sent, &found).unwrap();
        let fields: Vec<&str> = all.iter().map(|d| d.field.as_str()).collect();
        assert_eq!(
            fields,
            [
                "control.effects.waves.3.sine",
                "control.friction.coulomb",
                "limits.jump"
            ]
        );
        assert_eq!(
            all[0].to_string(),
            "control.effects.waves.3.sine: 0.5 and not 0"
        );
        assert_eq!(all[2].to_string(), "limits.jump: 1001 and not 1000");
        // 0.1 in single precision is a longer number in double.
        found.limits.bus_max = 0.1;
        assert!(
            differences(&sent, &found)
                .unwrap()
                .iter()
                .any(|d| d.to_string() == "limits.bus_max: 0.1 and not 1")
        );
    }
}
