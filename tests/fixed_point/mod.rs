//! The image without floating point: the same drive, in numbers of 16 bits before and 16 after the point.

mod envelope;

use bristle::emulate::{self, Board, OnHost, Transport, Tuned};
use bristle_core::drive::{Fault, Number, Parameters, Refusal};
use bristle_core::link::{Answer, Command, Counters, Injection};
use bristle_core::scalar::Q16;
use object::Object;

use crate::emulator::{Calls, booted_fixed, fixed_images, runnable_fixed_images};
use crate::{
    SENSORS, SETUP, assert_followed, assert_same, follow, healthy, in_flash, in_ram, model,
    occupied, plan, status, switched_on, within_budget,
};

fn tuned<T: Number>() -> Tuned<T> {
    emulate::tuned(&model(), &SETUP, &SENSORS).expect("a controller")
}

#[cfg(feature = "log")]
pub fn parameters() -> Parameters<Q16> {
    tuned().parameters
}

/// A board that is set up and on.
fn running(transport: Transport, parameters: &Parameters<Q16>) -> Option<Board<Q16>> {
    Some(switched_on(booted_fixed(transport)?, *parameters))
}

/// Over reversals, bristles, gravity and all, and as well as in floating point.
#[test]
fn ten_seconds_in_fixed_point_equal_the_hosts_bit_for_bit() {
    let Tuned { parameters, units } = tuned();
    let Some(mut board) = running(Transport::Fast, &parameters) else {
        return;
    };
    let plan = plan(10_000, &units);
    let mut host = OnHost::new(parameters).expect("valid parameters");
    let (board, host) = (follow(&mut board, &plan), follow(&mut host, &plan));
    assert_same(&board, &host);
    assert_followed(&board);
}

#[test]
fn the_serial_port_gives_the_same_as_the_fast_transport_in_fixed_point() {
    let Tuned { parameters, units } = tuned();
    let Some(mut serial) = running(Transport::Serial, &parameters) else {
        return;
    };
    let plan = plan(300, &units);
    let mut host = OnHost::new(parameters).expect("valid parameters");
    assert_same(&follow(&mut serial, &plan), &follow(&mut host, &plan));
    assert_eq!(status(&mut serial).2, Counters::default());
}

#[test]
fn the_command_gives_the_same_bytes_with_and_without_the_emulator_in_fixed_point() {
    let Some(images) = runnable_fixed_images() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("axis.toml"), crate::AXIS).expect("it is written");
    let image = images.firmware.to_str().expect("UTF-8");
    let run = |verb: &str, out: &str, more: &[&str]| {
        let mut arguments = vec![verb, "--board", "stm32f100", "--model", "axis.toml"];
        arguments.extend(["--compensate", "--follow", "position", "--limit", "1"]);
        arguments.extend(["--excite", "chirp", "--amplitude", "0.3", "--band", "0.2:2"]);
        arguments.extend(["--duration", "3", "--out", out]);
        arguments.extend(more);
        crate::bristle(folder.path(), &arguments)
    };
    let written = |out: &str| std::fs::read(folder.path().join(out)).expect("it was written");
    let page = ["--image", image, "--report", "run.html"];
    assert_eq!(run("emulate", "emulated.csv", &page).0, Some(0));
    assert_eq!(run("emulate", "host.csv", &["--on-host"]).0, Some(0));
    assert!(written("emulated.csv") == written("host.csv"));
    let page = String::from_utf8(written("run.html")).expect("text");
    assert!(page.contains("in fixed point"));
    // It has no ring, and refuses before anything is run or written.
    let (status, said) = run("emulate", "ring.csv", &["--ring", "--image", image]);
    assert!(status == Some(2) && said.contains("no memory"), "{said}");
    assert!(!folder.path().join("ring.csv").exists());
}

/// Faults, parameters over a restart, and the largest answers: with these the stack has been as deep as it gets.
#[test]
fn faults_and_parameters_are_handled_in_8_kb() {
    let Tuned { parameters, .. } = tuned::<Q16>();
    let Some(mut board) = running(Transport::Serial, &parameters) else {
        return;
    };
    assert!((0..5).all(|_| healthy(&mut board).bridge));
    board
        .tell(Command::Inject(Injection::CorruptParameter))
        .expect("it is injected");
    let tripped = (0..=64).find_map(|_| {
        let period = healthy(&mut board);
        (!period.bridge).then_some(period.faults)
    });
    assert!(tripped.is_some_and(|faults| faults.contains(Fault::CorruptParameters)));
    assert_eq!(
        board.ask(Command::Enable).expect("an answer"),
        Answer::Refused(Refusal::Faulted)
    );
    board
        .tell(Command::Set(parameters))
        .expect("parameters heal");
    board.tell(Command::Clear).expect("a fault is cleared");
    board.tell(Command::Store).expect("they are stored");
    board.restart().expect("the board starts anew");
    assert_eq!(
        board.ask(Command::Get).expect("an answer"),
        Answer::Parameters(parameters)
    );
    board.tell(Command::Store).expect("they are stored again");
    board.tell(Command::Enable).expect("nothing is wrong");
    assert!((0..100).all(|_| healthy(&mut board).bridge));
    let Answer::Status { counters, .. } = board.ask(Command::Status).expect("an answer") else {
        panic!("no status")
    };
    within_budget("vldiscovery_stack_bytes", counters.stack.into());
}

#[test]
fn the_image_in_fixed_point_fits_its_budget() {
    let Some(images) = fixed_images() else { return };
    let bytes = std::fs::read(&images.firmware).expect("the image was just built");
    let image = object::File::parse(&*bytes).expect("the image is an ELF file");
    for (key, used) in [
        ("vldiscovery_flash_bytes", occupied(&image, in_flash)),
        ("vldiscovery_static_ram_bytes", occupied(&image, in_ram)),
    ] {
        within_budget(key, used);
    }
}

/// The routines of the compiler's library for floating point, without `__aeabi_`: arithmetic, comparisons and conversions
/// (ARM RTABI 4.1.2, tables 2 to 8), where an `f` or a `d` goes before the names in `ON_BOTH`.
const ON_BOTH: [&str; 16] = [
    "add", "sub", "rsub", "mul", "div", "neg", "cmpeq", "cmplt", "cmple", "cmpge", "cmpgt",
    "cmpun", "2iz", "2uiz", "2lz", "2ulz",
];
const CONVERSIONS: [&str; 16] = [
    "f2d", "d2f", "f2h", "h2f", "d2h", "f2h_alt", "h2f_alt", "d2h_alt", "i2f", "ui2f", "l2f",
    "ul2f", "i2d", "ui2d", "l2d", "ul2d",
];
const FLAGS: [&str; 6] = [
    "cfcmpeq", "cfcmple", "cfrcmple", "cdcmpeq", "cdcmple", "cdrcmple",
];

/// Whether a symbol is one of them, by its name of the run-time ABI or by that of the compiler's library.
fn is_floating(name: &str) -> bool {
    let library = [
        "__addsf3", "__subsf3", "__mulsf3", "__divsf3", "__adddf3", "__subdf3", "__muldf3",
        "__divdf3",
    ];
    let Some(rest) = name.strip_prefix("__aeabi_") else {
        return library.iter().any(|l| name.contains(l));
    };
    let both = rest.strip_prefix(['f', 'd']);
    both.is_some_and(|operation| ON_BOTH.contains(&operation))
        || CONVERSIONS.contains(&rest)
        || FLAGS.contains(&rest)
}

#[test]
fn routines_for_floating_point_are_told_from_others() {
    for name in [
        "fdiv", "ddiv", "fadd", "drsub", "i2f", "ul2f", "i2d", "f2iz", "d2ulz", "cfcmple",
        "cdrcmple", "dcmpun",
    ] {
        assert!(is_floating(&format!("__aeabi_{name}")), "{name}");
    }
    assert!(is_floating("_ZN17compiler_builtins5float3div8__divsf3E"));
    for name in [
        "uidivmod",
        "idiv",
        "uldivmod",
        "ldivmod",
        "lmul",
        "memcpy",
        "memclr4",
        "lcmp",
        "unwind_cpp_pr0",
    ] {
        assert!(!is_floating(&format!("__aeabi_{name}")), "{name}");
    }
    assert!(!is_floating("ADC"));
}

#[test]
fn the_control_task_in_fixed_point_cannot_panic_and_nothing_computes_in_floating_point() {
    let Some(images) = fixed_images() else { return };
    let bytes = std::fs::read(&images.firmware).expect("the image was just built");
    let image = object::File::parse(&*bytes).expect("the image is an ELF file");
    let reached = Calls::of(&image).reachable("ADC");
    assert!(reached.len() > 2, "{reached:?}");
    let panics: Vec<_> = (reached.iter())
        .filter(|name| crate::leads_to_panic(name))
        .collect();
    assert!(panics.is_empty(), "{panics:?}");
    let floating: Vec<&str> = image
        .symbols()
        .filter_map(|s| object::ObjectSymbol::name(&s).ok())
        .filter(|name| is_floating(name))
        .collect();
    assert!(floating.is_empty(), "{floating:?}");
}

/// On the model of the STM32F405, as that of the STM32F100 has no timer to count with: the instructions are the same.
#[test]
fn a_control_period_in_fixed_point_fits_its_budget_of_instructions() {
    if let Some(images) = runnable_fixed_images() {
        crate::count_instructions(&images.cost, "vldiscovery_", 1);
        crate::count_instructions(&images.stages, "vldiscovery_", crate::STAGES);
        crate::count_instructions(&images.sets, "vldiscovery_", 1);
    }
}
