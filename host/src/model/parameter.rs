//! A model parameter: known, or to be estimated.

use std::fmt;

use toml_edit::{InlineTable, Item, Value};

/// A number that the model file gives, asks for, or bounds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameter {
    /// The value; `None` as long as it is unknown.
    pub value: Option<f64>,
    /// Kept as it is by every fit.
    pub known: bool,
    /// Lower bound of the estimate.
    pub min: Option<f64>,
    /// Upper bound of the estimate.
    pub max: Option<f64>,
    /// Standard error of the estimate.
    pub se: Option<f64>,
    /// What the recordings say of it.
    pub status: Status,
}

/// What recordings say of a parameter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// Nothing: it was given.
    #[default]
    Given,
    /// Ten standard errors from zero or more, or next to nothing for certain.
    Identified,
    /// Told from zero, but by less than ten standard errors.
    WeaklyExcited,
    /// Not told from zero: the recordings do not show it.
    NotExcited,
    /// Uncertain because another parameter, named here, has nearly the same effect on these recordings.
    TradedOff(String),
    /// Kept from moving on by a bound.
    AtBound,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Given => f.write_str("given"),
            Self::Identified => f.write_str("identified"),
            Self::WeaklyExcited => f.write_str("weakly excited"),
            Self::NotExcited => f.write_str("not excited"),
            Self::TradedOff(other) => write!(f, "traded off against {other}"),
            Self::AtBound => f.write_str("at a bound"),
        }
    }
}

impl Parameter {
    /// A parameter to be estimated.
    pub fn unknown() -> Self {
        Self::default()
    }

    /// A parameter that stays as it is.
    pub fn known(value: f64) -> Self {
        Self {
            value: Some(value),
            known: true,
            ..Self::default()
        }
    }

    /// `value` moved into the bounds.
    pub fn clamp(&self, value: f64) -> f64 {
        let value = self.min.map_or(value, |min| value.max(min));
        self.max.map_or(value, |max| value.min(max))
    }

    pub(super) fn from_toml(item: &Item) -> Result<Self, String> {
        let expected = "expected a number, \"?\" or a table { value = …, min = …, max = …, known = true|false, se = … }";
        if let Some(text) = item.as_str() {
            return if text == "?" {
                Ok(Self::unknown())
            } else {
                Err(format!("{text:?} is not a value; {expected}"))
            };
        }
        if let Some(value) = number(item) {
            return finite(value).map(Self::known);
        }
        let table = item.as_table_like().ok_or(expected)?;
        let mut parameter = Self::default();
        let mut known = None;
        for (key, item) in table.iter() {
            let get = || {
                number(item)
                    .ok_or_else(|| format!("{key} must be a number"))
                    .and_then(finite)
            };
            match key {
                "value" if item.as_str() == Some("?") => {}
                "value" => parameter.value = Some(get()?),
                "min" => parameter.min = Some(get()?),
                "max" => parameter.max = Some(get()?),
                "se" => parameter.se = Some(get()?),
                "known" => known = Some(item.as_bool().ok_or("known must be true or false")?),
                other => return Err(format!("{other:?} is not a key of a parameter; {expected}")),
            }
        }
        // A value with a standard error came from a fit; one without was put there by a person.
        parameter.known = known.unwrap_or(parameter.value.is_some() && parameter.se.is_none());
        if parameter.known && parameter.value.is_none() {
            return Err("known = true needs a value".to_owned());
        }
        if let (Some(min), Some(max)) = (parameter.min, parameter.max)
            && min > max
        {
            return Err(format!("min = {min} is above max = {max}"));
        }
        Ok(parameter)
    }

    pub(super) fn to_toml(&self) -> Item {
        let plain = Self {
            value: self.value,
            known: true,
            ..Self::default()
        };
        match self.value {
            Some(value) if *self == plain => Item::Value(Value::from(value)),
            None if *self == Self::unknown() => Item::Value(Value::from("?")),
            _ => {
                let mut table = InlineTable::new();
                let numbers = [
                    ("value", self.value),
                    ("se", self.se),
                    ("min", self.min),
                    ("max", self.max),
                ];
                for (key, value) in numbers {
                    if let Some(value) = value.filter(|v| v.is_finite()) {
                        table.insert(key, Value::from(value));
                    }
                }
                table.insert("known", Value::from(self.known));
                Item::Value(Value::InlineTable(table))
            }
        }
    }
}

fn number(item: &Item) -> Option<f64> {
    item.as_float()
        .or_else(|| item.as_integer().map(|i| i as f64))
}

fn finite(value: f64) -> Result<f64, String> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(format!("{value} is not a finite number"))
    }
}
