//! `bristle flash` with stand-ins for the two programs that write to boards.
#![cfg(unix)]

mod cli;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};

use cli::{Folder, Ran};

/// Where the flash begins.
const FLASH: u32 = 0x0800_0000;

/// A stand-in for dfu-util: `flash` in the working folder is the chip's flash.
const DFU_UTIL: &str = r#"#!/bin/sh
echo "$*" >> calls
if [ "$1" = --list ]; then
    echo 'dfu-util 0.11'
    cat listed
    exit 0
fi
while [ $# -gt 1 ]; do
    case $1 in
        --dfuse-address) span=$2 ;;
        --download) cp "$2" flash ;;
        --upload) [ ! -e "$2" ] && head -c "${span#*:}" flash > "$2" ;;
    esac
    shift
done
[ ! -e worn ] || cp worn flash
exit "$(cat status 2>/dev/null || echo 0)"
"#;

const IN_LOADER: &str = "Found DFU: [0483:df11] ver=2200, devnum=9, cfg=1, intf=0, path=\"1-1\", alt=0, name=\"@Internal Flash  /0x08000000/04*016Kg,01*064Kg,07*128Kg\", serial=\"3276\"\n";

const PROBE_RS: &str = r#"#!/bin/sh
echo "$*" >> calls
[ "$1" = list ] && cat probes
exit "$(cat status 2>/dev/null || echo 0)"
"#;

const PROBE: &str =
    "The following debug probes were found:\n[0]: STLink V2 -- 0483:3748:0670 (ST-LINK)\n";
const NO_PROBE: &str = "No debug probes were found.\n";

/// A little-endian ELF file for ARM that loads each piece at its address.
fn elf(pieces: &[(u32, &[u8])]) -> Vec<u8> {
    let (header, entry) = (52_u32, 32_u32);
    let mut file = b"\x7fELF\x01\x01\x01".to_vec();
    file.resize(16, 0);
    let half = |file: &mut Vec<u8>, x: u16| file.extend(x.to_le_bytes());
    let word = |file: &mut Vec<u8>, x: u32| file.extend(x.to_le_bytes());
    // e_type ET_EXEC, e_machine EM_ARM, then e_version, e_entry, e_phoff, e_shoff, e_flags.
    half(&mut file, 2);
    half(&mut file, 40);
    for x in [1, FLASH, header, 0, 0] {
        word(&mut file, x);
    }
    for x in [52, 32, pieces.len() as u16, 40, 0, 0] {
        half(&mut file, x);
    }
    let mut offset = header + entry * pieces.len() as u32;
    for (address, bytes) in pieces {
        let size = bytes.len() as u32;
        // PT_LOAD, p_offset, p_vaddr, p_paddr, p_filesz, p_memsz, p_flags, p_align.
        for x in [1, offset, *address, *address, size, size, 5, 4] {
            word(&mut file, x);
        }
        offset += size;
    }
    for (_, bytes) in pieces {
        file.extend(*bytes);
    }
    file
}

/// Stack at the end of the RAM, start behind the table, and something to run.
fn code() -> Vec<u8> {
    let mut code = 0x2002_0000_u32.to_le_bytes().to_vec();
    code.extend((FLASH + 9).to_le_bytes());
    code.extend(0..100);
    code
}

/// Code, a gap of four bytes, data.
fn image() -> Vec<u8> {
    elf(&[(FLASH, &code()), (FLASH + 112, &[1, 2, 3])])
}

/// What the flash holds of it.
fn flat() -> Vec<u8> {
    let mut flat = code();
    flat.extend([0xFF; 4]);
    flat.extend([1, 2, 3]);
    flat
}

/// Held while a stand-in is written and while a process is started: a child that another test forks in between would
/// inherit the open file, and a file that is open for writing cannot be run.
static STARTING: Mutex<()> = Mutex::new(());

/// A folder with an image and with the programs given.
fn bench(programs: &[(&str, &str)]) -> Folder {
    let _writing = STARTING.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = Folder::new();
    folder.write("firmware.elf", image());
    for (name, script) in programs {
        folder.write(name, script);
        let executable = fs::Permissions::from_mode(0o755);
        fs::set_permissions(folder.path(name), executable).expect("sets a mode");
    }
    folder
}

/// Runs `bristle` with a search path.
fn with_path(folder: &Folder, line: &str, path: &str) -> Ran {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bristle"));
    command
        .args(line.split_whitespace())
        .current_dir(folder.path(""))
        .env("PATH", path)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let child = {
        let _starting = STARTING.lock().unwrap_or_else(PoisonError::into_inner);
        command.spawn().expect("the program starts")
    };
    let Output {
        status,
        stdout,
        stderr,
    } = child.wait_with_output().expect("the program ends");
    let text = |bytes| String::from_utf8(bytes).expect("output is UTF-8");
    Ran {
        status: status.code().expect("the program ends by itself"),
        stdout: text(stdout),
        stderr: text(stderr),
    }
}

/// Runs `bristle` with the folder first in the search path, and what the stand-ins are written with behind it.
fn run(folder: &Folder, line: &str) -> Ran {
    let path = format!("{}:/usr/bin:/bin", folder.path("").display());
    with_path(folder, line, &path)
}

const BY_DFU: &str = "flash odrive-v3 --image firmware.elf --with dfu-util";
const BY_PROBE: &str = "flash odrive-v3 --image firmware.elf --with probe-rs";

/// What a refused command line says, on one line of words.
fn refused(folder: &Folder, line: &str) -> String {
    let ran = run(folder, line);
    assert_eq!(ran.status, 2, "{line}: {ran:?}");
    ran.stderr.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn the_loader_gets_the_image_and_it_is_read_back() {
    let folder = bench(&[("dfu-util", DFU_UTIL)]);
    folder.write("listed", IN_LOADER);
    let ran = run(&folder, BY_DFU);
    assert_eq!(ran.status, 0, "{ran:?}");
    assert!(ran.stdout.contains("The flash holds the image."), "{ran:?}");
    assert!(ran.stdout.contains("switch back to RUN"), "{ran:?}");
    assert_eq!(fs::read(folder.path("flash")).expect("flashed"), flat());
    let calls = folder.read("calls");
    let lines: Vec<&str> = calls.lines().collect();
    let to = "--device 0483:df11 --alt 0 --dfuse-address 0x08000000";
    assert_eq!(lines[0], "--list");
    assert!(
        lines[1].starts_with(&format!("{to} --download ")),
        "{calls}"
    );
    assert!(
        lines[2].starts_with(&format!("{to}:115 --upload ")),
        "{calls}"
    );
    assert_eq!(lines.len(), 3);
}

#[test]
fn flash_that_holds_something_else_is_told() {
    let folder = bench(&[("dfu-util", DFU_UTIL)]);
    folder.write("listed", IN_LOADER);
    let mut worn = flat();
    worn[0x20] ^= 1;
    folder.write("worn", worn);
    let said = refused(&folder, BY_DFU);
    assert!(said.contains("differs from 0x08000020 on"), "{said}");
    folder.write("worn", &flat()[..64]);
    let said = refused(&folder, BY_DFU);
    assert!(said.contains("0x08000040 on (64 of 115 bytes"), "{said}");
}

#[test]
fn the_probe_program_verifies_and_restarts() {
    let folder = bench(&[("probe-rs", PROBE_RS)]);
    folder.write("probes", PROBE);
    let ran = run(&folder, &format!("{BY_PROBE} --select 0483:3748:0670"));
    assert_eq!(ran.status, 0, "{ran:?}");
    let chip = "--chip STM32F405RGTx --probe 0483:3748:0670";
    let calls = format!("list\ndownload {chip} --verify firmware.elf\nreset {chip}\n");
    assert_eq!(folder.read("calls"), calls);
}

#[test]
fn the_program_that_reaches_a_board_is_taken() {
    let folder = bench(&[("probe-rs", PROBE_RS), ("dfu-util", DFU_UTIL)]);
    folder.write("listed", IN_LOADER);
    folder.write("probes", NO_PROBE);
    let ran = run(&folder, "flash odrive-v3 --image firmware.elf");
    assert_eq!(ran.status, 0, "{ran:?}");
    assert!(ran.stdout.contains("by dfu-util"), "{ran:?}");
    folder.write("probes", PROBE);
    let ran = run(&folder, "flash odrive-v3 --image firmware.elf");
    assert!(ran.stdout.contains("by probe-rs"), "{ran:?}");
}

#[test]
fn what_is_missing_is_said_with_how_to_get_it() {
    let folder = bench(&[]);
    let alone = |line: &str| {
        let ran = with_path(&folder, line, &folder.path("").display().to_string());
        assert_eq!(ran.status, 2, "{line}: {ran:?}");
        ran.stderr
    };
    for line in [
        "flash odrive-v3 --image firmware.elf",
        "flash odrive-v3 --image firmware.elf --dry-run",
    ] {
        let said = alone(line);
        assert!(said.contains("cargo install probe-rs-tools"), "{said}");
        assert!(said.contains("apt install dfu-util"), "{said}");
    }
    assert!(!alone(BY_PROBE).contains("dfu-util"));
}

#[test]
fn boards_out_of_reach_are_told_apart() {
    let folder = bench(&[("probe-rs", PROBE_RS), ("dfu-util", DFU_UTIL)]);
    folder.write("probes", NO_PROBE);
    folder.write("listed", "");
    let said = refused(&folder, "flash odrive-v3 --image firmware.elf");
    assert!(
        said.contains("sees no debug probe; connect SWDIO"),
        "{said}"
    );
    assert!(said.contains("set the board's switch to DFU"), "{said}");
    let locked =
        "dfu-util: Cannot open DFU device 0483:df11 found on devnum 9 (LIBUSB_ERROR_ACCESS)\n";
    folder.write("listed", locked);
    let said = refused(&folder, BY_DFU);
    assert!(said.contains("ATTRS{idProduct}==\"df11\""), "{said}");
    assert!(!folder.read("calls").contains("download"));
}

#[test]
fn a_failing_program_stops_the_command() {
    let folder = bench(&[("probe-rs", PROBE_RS), ("dfu-util", DFU_UTIL)]);
    folder.write("probes", PROBE);
    folder.write("listed", IN_LOADER);
    folder.write("status", "3");
    let said = refused(&folder, BY_PROBE);
    assert!(said.contains("at: probe-rs download --chip"), "{said}");
    assert!(!folder.read("calls").contains("reset"));
    assert!(refused(&folder, BY_DFU).contains("--download"));
    assert!(!folder.read("calls").contains("--upload"));
}

#[test]
fn a_dry_run_shows_the_commands_and_calls_nothing() {
    let folder = bench(&[("probe-rs", PROBE_RS), ("dfu-util", DFU_UTIL)]);
    let ran = run(&folder, &format!("{BY_PROBE} --dry-run"));
    assert_eq!(ran.status, 0, "{ran:?}");
    let line = "probe-rs download --chip STM32F405RGTx --verify firmware.elf";
    assert!(ran.stdout.contains(line), "{ran:?}");
    let ran = run(&folder, &format!("{BY_DFU} --dry-run"));
    assert!(ran.stdout.contains("0x08000000:115 --upload"), "{ran:?}");
    assert!(!folder.path("calls").exists());
}

#[test]
fn what_is_no_image_for_the_board_is_refused_before_anything_is_called() {
    let folder = bench(&[("probe-rs", PROBE_RS)]);
    folder.write("probes", PROBE);
    let mut of_host = image();
    // EM_X86_64.
    of_host[18] = 62;
    let high = elf(&[(FLASH, &code()), (FLASH + 0xC_0000, &[1])]);
    let ram = elf(&[(0x2000_0000, &code())]);
    let mut odd = code();
    odd[4] = 8;
    let bad: [(&str, Vec<u8>, &str); 6] = [
        ("text", b"no image".to_vec(), "is no 32-bit ELF file"),
        ("host", of_host, "is not for an ARM processor"),
        ("high", high, "puts 1 bytes at 0x080c0000, outside"),
        ("ram", ram, "at 0x20000000, outside"),
        ("odd", elf(&[(FLASH, &odd)]), "start at 0x08000008"),
        ("empty", elf(&[]), "holds no vector table"),
    ];
    for (name, file, what) in bad {
        folder.write("firmware.elf", file);
        let said = refused(&folder, BY_PROBE);
        assert!(said.contains("firmware.elf: "), "{name}: {said}");
        assert!(said.contains(what), "{name}: {said}");
    }
    assert!(!folder.read("calls").contains("download"));
    let said = refused(&folder, &BY_PROBE.replace("firmware", "none"));
    assert!(said.contains("none.elf: cannot be read"), "{said}");
}
