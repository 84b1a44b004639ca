//! Laws in single precision and in fixed point, held to what their rounding steps allow.
//!
//! The bound is derived, not observed: a law is written once, for any [`Scalar`], and so it also runs in
//! [`Tracked`], a number that carries the value of the reference and a bound on how far a given number type can be
//! from it. Every operation propagates the bounds of its operands and adds its own rounding (running error
//! analysis: Wilkinson 1986; Higham 2002, section 3.3). The rules, for operands `a ± α` and `b ± β`:
//!
//! | operation | bound, before the rounding of the result |
//! | --- | --- |
//! | a ± b | α + β |
//! | a·b | abs(a)·β + abs(b)·α + α·β |
//! | a/b | (α + abs(a/b)·β)/(abs(b) − β) |
//! | √a | α/√(a − α), or √α where that is less |
//! | eᵃ | eᵃ·(e^α − 1) |
//! | 1 − e^(−a) | α·e^(−(a − α)), its slope being e^(−a) |
//! | (1 − e^(−a))/a | α·min(1/2, 1/(a − α)²), its slope being at most both |
//!
//! The roundings are those that the number types document: [`Rounding`].

use std::cmp::Ordering;
use std::fmt::Debug;
use std::marker::PhantomData;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use bristle_core::Scalar;
use bristle_core::friction::{
    CoulombViscous, Curve, Dahl, Dynamic, Friction, LuGre, ModifiedLuGre, Planar, Static, Stribeck,
};
use bristle_core::scalar::Q16;
use proptest::prelude::*;

/// How a number type rounds. Each bound includes the rounding of the reference, 2⁻⁵³ relative.
trait Rounding: Copy + Debug {
    type Number: Scalar;
    /// Of a sum.
    fn sum(value: f64) -> f64;
    /// Of a product, a quotient or a constant.
    fn product(value: f64) -> f64;
    /// Of a square root.
    fn root(value: f64) -> f64;
    /// Of an exponential.
    fn exponential(value: f64) -> f64;
    /// Of a relaxation, or of its mean.
    fn relaxation(value: f64) -> f64;
}

const U64: f64 = f64::EPSILON / 2.0;

#[derive(Clone, Copy, Debug)]
struct Single;

impl Single {
    /// Half the distance of neighbours, which for subnormal numbers is 2⁻¹⁵⁰.
    fn units(count: f64, value: f64) -> f64 {
        count * ((f64::from(f32::EPSILON) / 2.0 + U64) * value.abs() + 2_f64.powi(-150))
    }
}

impl Rounding for Single {
    type Number = f32;
    fn sum(value: f64) -> f64 {
        Self::units(1.0, value)
    }
    fn product(value: f64) -> f64 {
        Self::units(1.0, value)
    }
    fn root(value: f64) -> f64 {
        Self::units(1.0, value)
    }
    fn exponential(value: f64) -> f64 {
        Self::units(2.0, value)
    }
    fn relaxation(value: f64) -> f64 {
        Self::units(17.0, value)
    }
}

#[derive(Clone, Copy, Debug)]
struct Fixed;

const HALF: f64 = 1.0 / 131_072.0;

impl Rounding for Fixed {
    type Number = Q16;
    fn sum(value: f64) -> f64 {
        U64 * value.abs()
    }
    fn product(value: f64) -> f64 {
        HALF + U64 * value.abs()
    }
    fn root(value: f64) -> f64 {
        2.0 * HALF + U64 * value.abs()
    }
    fn exponential(value: f64) -> f64 {
        HALF + 2_f64.powi(-25) * value + 2.0 * U64 * value
    }
    fn relaxation(value: f64) -> f64 {
        HALF + 2_f64.powi(-21) + 17.0 * U64 * value
    }
}

/// The reference and how far a number that rounds by `R` may be from it.
#[derive(Clone, Copy, Debug)]
struct Tracked<R> {
    value: f64,
    error: f64,
    rounding: PhantomData<R>,
}

impl<R: Rounding> Tracked<R> {
    /// A result: the number type rounds something up to `error` away from `value`.
    fn result(value: f64, error: f64, rounding: fn(f64) -> f64) -> Self {
        Self {
            value,
            error: error + rounding(value.abs() + error),
            rounding: PhantomData,
        }
    }

    /// A value that the number type holds exactly.
    fn exact(value: R::Number) -> Self {
        Self::result(value.to_f64(), 0.0, |_| 0.0)
    }
}

impl<R> PartialEq for Tracked<R> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<R> PartialOrd for Tracked<R> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<R: Rounding> Add for Tracked<R> {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self::result(self.value + b.value, self.error + b.error, R::sum)
    }
}

impl<R: Rounding> Sub for Tracked<R> {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        Self::result(self.value - b.value, self.error + b.error, R::sum)
    }
}

impl<R: Rounding> Mul for Tracked<R> {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        let error = self.value.abs() * b.error + b.value.abs() * self.error + self.error * b.error;
        Self::result(self.value * b.value, error, R::product)
    }
}

impl<R: Rounding> Div for Tracked<R> {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let quotient = self.value / b.value;
        let smallest = b.value.abs() - b.error;
        assert!(smallest > 0.0, "a divisor that may be zero");
        Self::result(
            quotient,
            (self.error + quotient.abs() * b.error) / smallest,
            R::product,
        )
    }
}

impl<R: Rounding> Neg for Tracked<R> {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            ..self
        }
    }
}

impl<R: Rounding> AddAssign for Tracked<R> {
    fn add_assign(&mut self, b: Self) {
        *self = *self + b;
    }
}

impl<R: Rounding> SubAssign for Tracked<R> {
    fn sub_assign(&mut self, b: Self) {
        *self = *self - b;
    }
}

impl<R: Rounding> Scalar for Tracked<R> {
    const ZERO: Self = Self {
        value: 0.0,
        error: 0.0,
        rounding: PhantomData,
    };
    const ONE: Self = Self {
        value: 1.0,
        error: 0.0,
        rounding: PhantomData,
    };
    const EPSILON: Self = Self::ZERO;

    fn from_f64(value: f64) -> Self {
        Self::result(value, 0.0, R::product)
    }
    fn to_f64(self) -> f64 {
        self.value
    }
    fn from_i32(value: i32) -> Self {
        Self::result(value.into(), 0.0, R::sum)
    }
    fn floor(self) -> i32 {
        let (low, high) = (self.value - self.error, self.value + self.error);
        assert_eq!(low.floor(), high.floor(), "a floor that may be either");
        Scalar::floor(self.value)
    }
    fn half(self) -> Self {
        Self::result(0.5 * self.value, 0.5 * self.error, R::product)
    }
    fn share_of(self, whole: u32) -> u32 {
        self.value.share_of(whole)
    }
    fn wave(phase: u32) -> (Self, Self) {
        let (sine, cosine) = f64::wave(phase);
        let bound = |value| R::relaxation(value);
        (
            Self::result(sine, 0.0, bound),
            Self::result(cosine, 0.0, bound),
        )
    }
    fn sqrt(self) -> Self {
        let slope = self.error / (self.value - self.error).max(0.0).sqrt();
        Self::result(self.value.sqrt(), slope.min(self.error.sqrt()), R::root)
    }
    fn exp(self) -> Self {
        let value = self.value.exp();
        Self::result(value, value * self.error.exp_m1(), R::exponential)
    }
    fn relax(self) -> (Self, Self) {
        let (relaxed, mean) = self.value.relax();
        let least = (self.value - self.error).max(0.0);
        (
            Self::result(relaxed, self.error * (-least).exp(), R::relaxation),
            Self::result(
                mean,
                self.error * 0.5_f64.min(1.0 / (least * least)),
                R::relaxation,
            ),
        )
    }
}

/// A failing case is printed in full, so none is kept in a file.
fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Parameters, state and input in scaled units, where the numbers lie around 1.
#[derive(Clone, Copy, Debug)]
struct Case {
    coulomb: f64,
    viscous: f64,
    static_level: f64,
    stribeck_velocity: f64,
    bristle_stiffness: f64,
    bristle_damping: f64,
    /// Of the deflection at break-away.
    deflection: f64,
    velocity: f64,
    across: f64,
    dt: f64,
}

prop_compose! {
    fn velocity()(exponent in -3.0..2.0_f64, forward: bool) -> f64 {
        10_f64.powf(exponent) * if forward { 1.0 } else { -1.0 }
    }
}

prop_compose! {
    fn case()(
        static_level in 0.3..3.0_f64,
        share in 0.4..1.0_f64,
        viscous in 0.0..0.1_f64,
        stribeck_velocity in 0.1..10.0_f64,
        bristle_stiffness in 0.3..3.0_f64,
        bristle_damping in 0.0..2.0_f64,
        deflection in -1.0..1.0_f64,
        velocity in velocity(),
        across in velocity(),
        dt in 0.2..2.0_f64,
    ) -> Case {
        Case {
            coulomb: share * static_level, viscous, static_level, stribeck_velocity,
            bristle_stiffness, bristle_damping, deflection, velocity, across, dt,
        }
    }
}

/// Every law built from a case, in one number type.
struct Laws<S> {
    coulomb_viscous: CoulombViscous<S>,
    stribeck: [Stribeck<S>; 2],
    sticking: Static<S>,
    dahl: Dahl<S>,
    lugre: LuGre<S>,
    modified_lugre: ModifiedLuGre<S>,
}

impl<S: Scalar> Laws<S> {
    fn new(case: &Case) -> Self {
        let [
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
            bristle_stiffness,
            bristle_damping,
        ] = [
            case.coulomb,
            case.viscous,
            case.static_level,
            case.stribeck_velocity,
            case.bristle_stiffness,
            case.bristle_damping,
        ]
        .map(S::from_f64);
        let stribeck = |curve| Stribeck {
            coulomb,
            viscous,
            static_level,
            stribeck_velocity,
            curve,
        };
        Self {
            coulomb_viscous: CoulombViscous { coulomb, viscous },
            stribeck: [Curve::Exponential, Curve::Rational].map(stribeck),
            sticking: Static {
                coulomb,
                viscous,
                static_level,
                stribeck_velocity,
            },
            dahl: Dahl {
                coulomb,
                viscous,
                bristle_stiffness,
            },
            lugre: LuGre {
                coulomb,
                viscous,
                static_level,
                stribeck_velocity,
                bristle_stiffness,
                bristle_damping,
            },
            modified_lugre: ModifiedLuGre {
                coulomb,
                viscous,
                static_level,
                stribeck_velocity,
                bristle_stiffness,
                bristle_damping,
            },
        }
    }
}

/// Everything that the laws compute from a case, with names.
fn outputs<S: Scalar>(case: &Case) -> Vec<(String, S)> {
    let laws = Laws::<S>::new(case);
    let s = S::from_f64;
    let (v, dt) = (s(case.velocity), s(case.dt));
    let mut found = vec![(
        "coulomb-viscous".to_owned(),
        laws.coulomb_viscous.sliding(v),
    )];
    for law in &laws.stribeck {
        found.push((format!("stribeck {:?}", law.curve), law.sliding(v)));
    }
    found.push(("static".to_owned(), laws.sticking.sliding(v)));
    let planar = Planar(laws.sticking).sliding([v, s(case.across)]);
    found.extend(planar.map(|force| ("planar".to_owned(), force)));
    bristles(&mut found, "dahl", &laws.dahl, case, v, dt);
    bristles(&mut found, "lugre", &laws.lugre, case, v, dt);
    bristles(
        &mut found,
        "modified-lugre",
        &laws.modified_lugre,
        case,
        v,
        dt,
    );
    found
}

fn bristles<S: Scalar>(
    found: &mut Vec<(String, S)>,
    name: &str,
    law: &impl Dynamic<S>,
    case: &Case,
    v: S,
    dt: S,
) {
    let z = S::from_f64(case.deflection * case.coulomb / case.bristle_stiffness);
    let step = law.step(z, v, dt);
    for (what, value) in [
        ("rate", law.rate(z, v)),
        ("force", law.force(z, v)),
        ("steady force", law.steady(v)),
        ("deflection by advance", law.advance(z, v, dt)),
        ("deflection by step", step.deflection),
        ("mean force", step.force),
    ] {
        found.push((format!("{name}, {what}"), value));
    }
}

/// Asserts the envelope on everything, and that it says something: that it is at most `share` of the largest number on
/// the way to the result, apart from the direction in the plane, which the resolution of a slow velocity limits.
fn assert_envelope<R: Rounding>(case: &Case, share: f64) -> Result<(), TestCaseError> {
    let low = outputs::<R::Number>(case);
    let tracked = outputs::<Tracked<R>>(case);
    let reference = outputs::<f64>(case);
    let largest = 1.0 + case.velocity.abs() * (1.0 + case.bristle_damping) * 10.0;
    let direction = 4.0 * R::Number::EPSILON.to_f64() / case.velocity.abs();
    let limit = share * largest + direction * case.static_level;
    for ((name, low), ((_, tracked), (_, reference))) in
        low.iter().zip(tracked.iter().zip(&reference))
    {
        let error = (low.to_f64() - reference).abs();
        prop_assert_eq!(tracked.value, *reference);
        prop_assert!(
            error <= tracked.error,
            "{}: {:e} > {:e}",
            name,
            error,
            tracked.error
        );
        prop_assert!(
            tracked.error <= limit,
            "{}: {:e} says nothing",
            name,
            tracked.error
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(4_000))]

    #[test]
    fn single_precision_stays_in_its_envelope(case in case()) {
        assert_envelope::<Single>(&case, 2e-5)?;
    }

    #[test]
    fn fixed_point_stays_in_its_envelope(case in case()) {
        assert_envelope::<Fixed>(&case, 5e-3)?;
    }
}

/// The deflections of a law along velocities, with the bound on their error in a number type.
///
/// With the step written as `z ← z·(1 − d) + z_ss·d`, an error at its start shrinks by `1 − d ≤ 1`; the step itself
/// adds what [`Tracked`] finds for a deflection that is exact at its start.
fn assert_trajectory<R: Rounding>(case: &Case, velocities: &[f64]) -> Result<(), TestCaseError> {
    let low_law = Laws::<R::Number>::new(case).lugre;
    let tracked_law = Laws::<Tracked<R>>::new(case).lugre;
    let law = Laws::<f64>::new(case).lugre;
    let dt = R::Number::from_f64(case.dt);
    let (mut low, mut reference, mut bound) = (R::Number::ZERO, 0.0, 0.0);
    for velocity in velocities {
        let velocity = R::Number::from_f64(*velocity);
        let start = Tracked::<R>::exact(low);
        let local = tracked_law.advance(start, Tracked::exact(velocity), Tracked::exact(dt));
        low = low_law.advance(low, velocity, dt);
        let (v, dt) = (velocity.to_f64(), dt.to_f64());
        reference = law.advance(reference, v, dt);
        let kept = (-(v.abs() * dt * law.bristle_stiffness / law.level(v))).exp();
        bound = bound * kept + local.error;
        let error = (low.to_f64() - reference).abs();
        prop_assert!(error <= bound, "{:e} > {:e}", error, bound);
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn trajectories_stay_in_their_envelope(
        case in case(),
        velocities in prop::collection::vec(velocity(), 300),
    ) {
        assert_trajectory::<Single>(&case, &velocities)?;
        assert_trajectory::<Fixed>(&case, &velocities)?;
    }
}
