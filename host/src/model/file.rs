//! Model files: reading to the contract, and writing values back into the same text.

use std::path::Path;

use bristle_core::friction::Curve;
use toml_edit::{DocumentMut, Item, Table, TableLike, value};

use super::kind::{Default, Spec};
use super::place::{self, Problem, at};
use super::{Causality, Columns, Constant, Kind, Law, Model, Motion, Parameter, Term};
use crate::effects::{self, Effect, Given};
use crate::error::{Error, Result};

impl Model {
    /// Reads a model file.
    pub fn read(path: &Path) -> Result<Self> {
        read(path, Self::parse)
    }

    /// Reads a model file, a DC motor as the axis that it is to fits, and refuses what can be simulated only.
    pub fn read_to_fit(path: &Path) -> Result<Self> {
        read(path, |text| {
            let model = Self::parse(text)?.into_axis()?;
            match model.unfittable().or_else(|| model.not_estimated()) {
                None => Ok(model),
                Some((key, what)) => Err(at(key, what).message(text)),
            }
        })
    }

    /// A DC motor as an axis under voltage: `k = a·kt/R` with `a` the amplifier's gain, `ke/a` as its back-EMF, and `L/R`
    /// as the time constant of its winding, which is 0 where the inductance is not given. Other models as they are.
    fn into_axis(self) -> std::result::Result<Self, String> {
        if self.kind != Kind::DcMotor {
            return Ok(self);
        }
        let given = ["resistance", "torque_constant", "back_emf"].map(|name| {
            let value = self.constant(&format!("plant.{name}"));
            (name, Some(value).filter(|v| v.is_finite()))
        });
        let amplifier = ("gain", self.gain.value.filter(|_| self.gain.known));
        if let Some((name, _)) = given.iter().chain([&amplifier]).find(|(_, v)| v.is_none()) {
            return Err(format!(
                "plant.{name} has no value: a dc-motor is fitted as an axis with the gain gain·torque_constant/resistance; write numbers for gain, resistance, torque_constant and back_emf, or fit an axis with an unknown gain or inertia"
            ));
        }
        let [resistance, torque_constant, back_emf] = given.map(|(_, v)| v.unwrap_or_default());
        let amplifier = amplifier.1.unwrap_or_default();
        let inductance = self.constant("plant.inductance");
        let mut document = self.document;
        let plant = table(&mut document, "plant");
        for name in ["kind", "resistance", "inductance", "torque_constant"] {
            plant.remove(name);
        }
        put(plant, "input", value("voltage"));
        put(
            plant,
            "gain",
            value(amplifier * torque_constant / resistance),
        );
        put(plant, "back_emf", value(back_emf / amplifier));
        if inductance.is_finite() {
            put(
                plant,
                "electrical_time_constant",
                value(inductance / resistance),
            );
        }
        Self::parse(&document.to_string())
    }

    /// Parses the text of a model file; the message says what is wrong and under which key.
    pub fn parse(text: &str) -> std::result::Result<Self, String> {
        let document: DocumentMut = text.parse().map_err(|e| place::syntax(text, &e))?;
        Self::interpret(document).map_err(|problem| problem.message(text))
    }

    fn interpret(document: DocumentMut) -> Checked<Self> {
        only(
            document.as_table(),
            "",
            &["name", "plant", "friction", "columns", "effects"],
        )?;
        let plant = section(&document, "plant")?.ok_or_else(|| {
            at("plant", "the section [plant] is missing; it says at least motion = \"rotary\" or \"linear\"")
        })?;
        let kind = word(plant, "plant", "kind", &Kind::WORDS)?
            .map(Kind::from_word)
            .unwrap_or_default();
        let mut keys = vec!["kind", "motion", "input", "gain", "inertia", "causality"];
        keys.extend(kind.constants().iter().map(|spec| spec.name));
        only(plant, "plant", &keys)?;
        let motion =
            match word(plant, "plant", "motion", &["rotary", "linear"])?.ok_or_else(|| {
                at(
                    "plant.motion",
                    "plant.motion is missing; write \"rotary\" or \"linear\"",
                )
            })? {
                "rotary" => Motion::Rotary,
                _ => Motion::Linear,
            };
        let torque = if motion == Motion::Rotary {
            "torque"
        } else {
            "force"
        };
        let input = word(
            plant,
            "plant",
            "input",
            &["torque", "force", "voltage", "current"],
        )?
        .unwrap_or(if kind.is_electric() {
            "voltage"
        } else {
            torque
        });
        if let Some((key, what)) = kind.unsuited(motion, input) {
            return Err(at(key, what));
        }
        let causality = match word(plant, "plant", "causality", &["forward", "inverse"])? {
            Some("inverse") => Causality::Inverse,
            _ => Causality::Forward,
        };
        let gain = parameter(plant, "plant", "gain")?.unwrap_or_else(|| Parameter::known(1.0));
        let inertia = parameter(plant, "plant", "inertia")?.unwrap_or_default();
        for (name, parameter) in [("gain", &gain), ("inertia", &inertia)] {
            // An imposed motion needs no inertia.
            let may_vanish = name == "inertia" && causality == Causality::Inverse;
            let least = if may_vanish { 0.0 } else { f64::MIN_POSITIVE };
            let given = [parameter.value, parameter.max];
            if given.iter().flatten().any(|v| *v < least) {
                let key = format!("plant.{name}");
                return Err(at(
                    &key,
                    format!("{key} must be a positive number, or \"?\""),
                ));
            }
        }
        let given = section(&document, "friction")?;
        let (law, coulomb, viscous, mut terms) = friction(given)?;
        let constants = constants(Some(plant), "plant", kind.constants())?;
        // An estimate may come out below zero by its error, but nobody knows such a level.
        if coulomb.known && coulomb.value.is_some_and(|v| v < 0.0) {
            return Err(at(
                "friction.coulomb",
                "friction.coulomb is a level of friction and cannot be negative; write a positive number, or \"?\"",
            ));
        }
        let name = match document.get("name") {
            None => "axis",
            Some(name) => name
                .as_str()
                .ok_or_else(|| at("name", "name must be text in quotes"))?,
        };
        let axis = Given {
            motion,
            driven: causality == Causality::Forward,
            inertia: inertia.known && gain.known,
            friction: coulomb.known || viscous.known,
        };
        terms.extend(effect_terms(section(&document, "effects")?, axis, &terms)?);
        Ok(Self {
            name: name.to_owned(),
            motion,
            input: input.to_owned(),
            causality,
            kind,
            law,
            gain,
            inertia,
            coulomb,
            viscous,
            terms,
            constants,
            columns: columns(section(&document, "columns")?)?,
            document,
        })
    }

    /// The model file with the present values, the user's comments and layout kept.
    pub fn to_toml(&self) -> String {
        let mut document = self.document.clone();
        let plant = table(&mut document, "plant");
        put(plant, "gain", self.gain.to_toml());
        put(plant, "inertia", self.inertia.to_toml());
        let friction = table(&mut document, "friction");
        if !friction.contains_key("model") {
            friction.insert("model", value("coulomb-viscous"));
        }
        if self.law == Law::Stribeck && self.curve() == Curve::Rational {
            put(friction, "curve", value(RATIONAL));
        }
        put(friction, "coulomb", self.coulomb.to_toml());
        put(friction, "viscous", self.viscous.to_toml());
        for term in &self.terms {
            let section = if term.in_law {
                table(&mut document, "friction")
            } else {
                let effects = table(&mut document, "effects");
                effects.set_implicit(true);
                subtable(effects, term.effect.id())
            };
            for (spec, parameter) in term.effect.parameters().iter().zip(&term.parameters) {
                put(section, spec.name, parameter.to_toml());
            }
        }
        document.to_string()
    }
}

fn read(path: &Path, parse: impl Fn(&str) -> std::result::Result<Model, String>) -> Result<Model> {
    let text = std::fs::read_to_string(path).map_err(|reason| Error::Unreadable {
        path: path.to_owned(),
        reason,
    })?;
    parse(&text).map_err(|what| Error::Model {
        path: path.to_owned(),
        what: if is_recording(path) {
            format!("{what}; by its name this is a recording, and a model file (TOML) belongs here")
        } else {
            what
        },
    })
}

fn is_recording(path: &Path) -> bool {
    let ending = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    ["csv", "parquet", "pq", "mat"].contains(&ending.to_ascii_lowercase().as_str())
}

/// What `friction.curve` may say of the law `stribeck`: `e^(−(v/vs)²)` or `1/(1 + (v/vs)²)`.
const CURVES: [&str; 2] = ["gaussian", RATIONAL];
const RATIONAL: &str = "rational";

type Checked<T> = std::result::Result<T, Problem>;
type Friction = (Law, Parameter, Parameter, Vec<Term>);

fn friction(section: Option<&dyn TableLike>) -> Checked<Friction> {
    let Some(section) = section else {
        return Ok((
            Law::CoulombViscous,
            Parameter::unknown(),
            Parameter::unknown(),
            Vec::new(),
        ));
    };
    let law = word(section, "friction", "model", &Law::WORDS)?
        .map_or(Law::CoulombViscous, Law::from_word);
    let curve = word(section, "friction", "curve", &CURVES)?;
    if curve.is_some() && law != Law::Stribeck {
        let what = "friction.curve is for model = \"stribeck\" alone; the other laws have a curve by themselves";
        return Err(at("friction.curve", what));
    }
    // Parts of the law beyond Coulomb and viscous friction; the exponent is the law's own unless the file says otherwise.
    let parts: Vec<(&'static dyn Effect, Option<f64>)> = match law {
        Law::CoulombViscous => Vec::new(),
        Law::Stribeck if curve == Some(RATIONAL) => vec![(&effects::law::RATIONAL, None)],
        Law::Stribeck => vec![(fall()?, Some(2.0))],
        Law::Static => vec![(fall()?, Some(1.0))],
        Law::Dahl => vec![(&effects::law::BRISTLES, None)],
        Law::LuGre => vec![
            (&effects::law::EXPONENTIAL, None),
            (&effects::law::DAMPED_BRISTLES, None),
        ],
        Law::ModifiedLuGre => vec![
            (&effects::law::RATIONAL, None),
            (&effects::law::DAMPED_BRISTLES, None),
        ],
    };
    let names = parts.iter().flat_map(|(part, _)| part.parameters());
    let mut keys = vec!["model", "coulomb", "viscous"];
    keys.extend((law == Law::Stribeck).then_some("curve"));
    keys.extend(names.map(|spec| spec.name));
    only(section, "friction", &keys)?;
    let get = |name| parameter(section, "friction", name);
    let part = |(effect, exponent): (&'static dyn Effect, Option<f64>)| {
        let mut parameters = Vec::new();
        for spec in effect.parameters() {
            let given = get(spec.name)?;
            check_bounds(spec, "friction", given.as_ref())?;
            let otherwise = exponent
                .filter(|_| spec.name == "exponent")
                .map_or_else(Parameter::unknown, Parameter::known);
            parameters.push(given.unwrap_or(otherwise));
        }
        Ok(Term {
            effect,
            parameters,
            in_law: true,
        })
    };
    let terms = parts.into_iter().map(part).collect::<Checked<Vec<_>>>()?;
    let known = |name| get(name).map(Option::unwrap_or_default);
    Ok((law, known("coulomb")?, known("viscous")?, terms))
}

fn fall() -> Checked<&'static dyn Effect> {
    effects::find("stribeck")
        .ok_or_else(|| at("friction.model", "the stribeck effect is not built in"))
}

/// Refuses a known value that physics rules out.
fn check_bounds(spec: &effects::Spec, section: &str, given: Option<&Parameter>) -> Checked<()> {
    let (least, most) = spec.bounds;
    match given.filter(|p| p.known).and_then(|p| p.value) {
        Some(value) if value < least || value > most => {
            let key = format!("{section}.{}", spec.name);
            let what = match spec.bounds {
                (0.0, f64::INFINITY) => "zero or positive".to_owned(),
                (_, f64::INFINITY) => "positive".to_owned(),
                _ => format!("between {least} and {most}"),
            };
            Err(at(&key, format!("{key} must be {what}")))
        }
        _ => Ok(()),
    }
}

/// Constants of a section, those left out at their defaults.
fn constants(
    section: Option<&dyn TableLike>,
    name: &str,
    specs: &[Spec],
) -> Checked<Vec<Constant>> {
    let mut constants: Vec<Constant> = Vec::new();
    for spec in specs {
        let key = format!("{name}.{}", spec.name);
        let given = match section {
            Some(section) => parameter(section, name, spec.name)?,
            None => None,
        };
        let strict = !matches!(spec.default, Default::Number(_));
        if let Some(value) = given.as_ref().and_then(|p| p.value)
            && (value < 0.0 || strict && value == 0.0)
        {
            let what = if strict {
                "positive"
            } else {
                "zero or positive"
            };
            return Err(at(&key, format!("{key} must be {what}")));
        }
        let parameter = given.unwrap_or_else(|| match spec.default {
            Default::Unknown => Parameter::unknown(),
            Default::Number(value) => Parameter::known(value),
            Default::SameAs(other) => {
                let other = format!("{name}.{other}");
                let mut found = constants.iter().filter(|c| c.key == other);
                found
                    .next()
                    .map_or_else(Parameter::unknown, |c| c.parameter.clone())
            }
        });
        constants.push(Constant { key, parameter });
    }
    Ok(constants)
}

fn effect_terms(section: Option<&dyn TableLike>, axis: Given, law: &[Term]) -> Checked<Vec<Term>> {
    let Some(section) = section else {
        return Ok(Vec::new());
    };
    let mut terms = Vec::new();
    for (id, item) in section.iter() {
        let key = format!("effects.{id}");
        let effect = effects::find(id).ok_or_else(|| at(&key, unknown_effect(id)))?;
        if law.iter().any(|t| t.effect.id() == id) {
            return Err(at(
                &key,
                format!(
                    "[effects.{id}] repeats what friction.model has already; remove one of the two"
                ),
            ));
        }
        if let Some(reason) = effect.unsuited(axis) {
            return Err(at(
                &key,
                format!("[effects.{id}] does not apply here, because {reason}; remove the section"),
            ));
        }
        let table = item
            .as_table_like()
            .ok_or_else(|| at(&key, format!("{key} must be a section [{key}]")))?;
        terms.push(term(effect, table)?);
    }
    Ok(terms)
}

fn term(effect: &'static dyn Effect, table: &dyn TableLike) -> Checked<Term> {
    let section = format!("effects.{}", effect.id());
    // Another form is meant where a parameter is given that only that has.
    let own = |name: &str| effect.parameters().iter().any(|s| s.name == name);
    let only_its = |form: &&dyn Effect| {
        let mut names = form.parameters().iter().map(|s| s.name);
        names.any(|name| !own(name) && table.contains_key(name))
    };
    let has_all = |form: &&dyn Effect| {
        let known = |key: &str| form.parameters().iter().any(|s| s.name == key);
        table.iter().all(|(key, _)| known(key))
    };
    let others: Vec<_> = (effect.other_forms().iter().copied())
        .filter(only_its)
        .collect();
    let meant = others.iter().copied().find(has_all);
    let effect = meant.or(others.first().copied()).unwrap_or(effect);
    let names: Vec<&str> = effect.parameters().iter().map(|s| s.name).collect();
    only(table, &section, &names)?;
    let read = |spec: &effects::Spec| {
        let given = parameter(table, &section, spec.name)?;
        check_bounds(spec, &section, given.as_ref())?;
        Ok(given.unwrap_or_default())
    };
    let specs = effect.parameters().iter();
    let mut parameters = specs.map(read).collect::<Checked<Vec<_>>>()?;
    // A shape left out beside given numbers has the textbook value.
    if let Some((shape, textbook)) = effect.shape().zip(effect.textbook())
        && !table.contains_key(names[shape])
        && parameters.iter().any(|p| p.known)
    {
        parameters[shape] = Parameter::known(textbook);
    }
    Ok(Term {
        effect,
        parameters,
        in_law: false,
    })
}

fn unknown_effect(id: &str) -> String {
    let ids: Vec<&str> = effects::ALL.iter().map(|e| e.id()).collect();
    format!(
        "[effects.{id}] is not an effect; there are {}",
        ids.join(", ")
    )
}

fn columns(section: Option<&dyn TableLike>) -> Checked<Columns> {
    let Some(section) = section else {
        return Ok(Columns::new());
    };
    only(
        section,
        "columns",
        &["t", "u", "q", "v", "i", "temp", "q_ref"],
    )?;
    let entry = |(key, item): (&str, &Item)| {
        let name = item.as_str().ok_or_else(|| {
            at(
                &format!("columns.{key}"),
                format!("columns.{key} must be a column name in quotes"),
            )
        })?;
        Ok((key.to_owned(), name.to_owned()))
    };
    section.iter().map(entry).collect()
}

fn section<'a>(document: &'a DocumentMut, name: &str) -> Checked<Option<&'a dyn TableLike>> {
    match document.get(name) {
        None => Ok(None),
        Some(item) => item
            .as_table_like()
            .map(Some)
            .ok_or_else(|| at(name, format!("{name} must be a section [{name}]"))),
    }
}

fn parameter(table: &dyn TableLike, section: &str, name: &str) -> Checked<Option<Parameter>> {
    let Some(item) = table.get(name) else {
        return Ok(None);
    };
    Parameter::from_toml(item).map(Some).map_err(|what| {
        at(
            &format!("{section}.{name}"),
            format!("{section}.{name}: {what}"),
        )
    })
}

fn word<'a>(
    table: &'a dyn TableLike,
    section: &str,
    key: &str,
    allowed: &[&str],
) -> Checked<Option<&'a str>> {
    let Some(item) = table.get(key) else {
        return Ok(None);
    };
    match item.as_str() {
        Some(word) if allowed.contains(&word) => Ok(Some(word)),
        _ => Err(at(
            &format!("{section}.{key}"),
            format!(
                "{section}.{key} must be one of \"{}\"",
                allowed.join("\", \"")
            ),
        )),
    }
}

/// Refuses keys that a section, or the file itself with an empty name, does not have.
fn only(table: &dyn TableLike, section: &str, allowed: &[&str]) -> Checked<()> {
    let Some((key, _)) = table.iter().find(|(key, _)| !allowed.contains(key)) else {
        return Ok(());
    };
    let (place, path) = if section.is_empty() {
        ("the file".to_owned(), key.to_owned())
    } else {
        (format!("[{section}]"), format!("{section}.{key}"))
    };
    Err(at(
        &path,
        format!(
            "{key:?} does not belong in {place}; it may hold {}",
            allowed.join(", ")
        ),
    ))
}

/// Sets a value; a comment beside the one it replaces stays.
fn put(table: &mut Table, key: &str, mut item: Item) {
    let before = table.get(key).and_then(Item::as_value);
    if let (Some(before), Some(new)) = (before.cloned(), item.as_value_mut()) {
        *new.decor_mut() = before.decor().clone();
    }
    table.insert(key, item);
}

fn table<'a>(document: &'a mut DocumentMut, name: &str) -> &'a mut Table {
    subtable(document.as_table_mut(), name)
}

/// The sub-table `name`, made if absent; an inline table becomes a section so that both can be edited alike.
fn subtable<'a>(parent: &'a mut Table, name: &str) -> &'a mut Table {
    let item = parent
        .entry(name)
        .or_insert_with(|| Item::Table(Table::new()));
    if !item.is_table() {
        let table = std::mem::take(item).into_table().unwrap_or_default();
        *item = Item::Table(table);
    }
    item.as_table_mut().expect("just made a table")
}

#[cfg(test)]
mod tests {
    use super::{Model, Parameter};

    const TEXT: &str = "name = \"axis\"\n[plant]\nmotion = \"linear\"\ninput = \"voltage\"\ngain = 35.15\ninertia = \"?\" # to find\n[friction]\nmodel = \"coulomb-viscous\"\ncoulomb = { value = 20.0, min = 0.0 }\n[effects.spring]\n[columns]\nu = \"vir\"\n";

    #[test]
    fn reads_values_unknowns_and_bounds() {
        let model = Model::parse(TEXT).unwrap();
        assert_eq!(model.gain, Parameter::known(35.15));
        assert_eq!(model.inertia, Parameter::unknown());
        assert!(model.coulomb.known && model.coulomb.min == Some(0.0));
        assert_eq!(model.viscous, Parameter::unknown());
        assert!(model.has("spring"));
        assert_eq!(model.columns["u"], "vir");
    }

    #[test]
    fn what_is_written_reads_back_the_same() {
        let mut model = Model::parse(TEXT)
            .unwrap()
            .with_effect(crate::effects::find("stribeck").unwrap());
        for (k, parameter) in model.parameters_mut().into_iter().enumerate() {
            if !parameter.known {
                parameter.value = Some(0.1 + k as f64 / 3.0);
                parameter.se = Some(1e-3);
            }
        }
        let text = model.to_toml();
        assert!(text.contains("# to find"), "{text}");
        let again = Model::parse(&text).unwrap();
        assert_eq!(again.parameters(), model.parameters());
        assert_eq!(again.labels(), model.labels());
    }

    #[test]
    fn messages_name_the_key() {
        let message = |text: &str| Model::parse(text).err().unwrap();
        assert!(
            message("[plant]\nmotion = \"round\"")
                .starts_with("line 2: plant.motion must be one of")
        );
        assert!(message("[plant]\n\ngain = 1").starts_with("line 1: plant.motion is missing"));
        assert!(message("[plant]\nmotion =").starts_with("line 2, column 9: not valid TOML"));
        assert!(message("plant = { motion = \"linear\",\n gain = -1 }").starts_with("line 2"));
        assert!(
            message("[plant]\nmotion = \"rotary\"\ninertia = \"big\"")
                .contains("plant.inertia: \"big\"")
        );
        assert!(
            message("[plant]\nmotion = \"rotary\"\nmass = 1")
                .contains("\"mass\" does not belong in [plant]")
        );
        assert!(
            message("[plant]\nmotion = \"rotary\"\n[effects.strybeck]")
                .contains("is not an effect")
        );
        assert!(
            message("[plant]\nmotion = \"linear\"\n[effects.gravity]").contains("does not apply")
        );
        for (given, what) in [
            (
                "backlash]\nmotor_friction = 1.5",
                "backlash.motor_friction must be between 0 and 1",
            ),
            (
                "delay]\ndelay = -1e-3",
                "delay.delay must be zero or positive",
            ),
            (
                "compliance]\nantiresonance = 0",
                "compliance.antiresonance must be positive",
            ),
        ] {
            let text = format!("[plant]\nmotion = \"rotary\"\n[effects.{given}");
            assert_eq!(message(&text), format!("line 4: effects.{what}"));
        }
    }
}
