//! Why a serial port may not be used, and what to do about it.

use std::path::Path;

/// What to do where opening a port was denied.
pub fn denied(port: &Path) -> String {
    let place = port.display();
    match owner(port) {
        Some(group) => format!(
            "you may not use it, as only the group {group} may: sudo usermod -aG {group} $USER, then log out and in again; until then, sudo setfacl -m u:$USER:rw {place}"
        ),
        None => format!(
            "you may not use it; ls -l {place} shows who may (on Linux often the group dialout)"
        ),
    }
}

/// The group that may read and write a device, by its name.
#[cfg(unix)]
fn owner(port: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    const READ_AND_WRITE_BY_GROUP: u32 = 0o060;
    let found = std::fs::metadata(port).ok()?;
    let allowed = found.mode() & READ_AND_WRITE_BY_GROUP == READ_AND_WRITE_BY_GROUP;
    let groups = std::fs::read_to_string("/etc/group").ok()?;
    group_named(&groups, found.gid()).filter(|name| allowed && name != "root")
}

#[cfg(not(unix))]
fn owner(_port: &Path) -> Option<String> {
    None
}

/// The name of a group in the text of `/etc/group`: `name:password:number:members`.
#[cfg(unix)]
fn group_named(groups: &str, number: u32) -> Option<String> {
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let (name, its) = (fields.next()?, fields.nth(1)?);
        (its.parse() == Ok(number)).then(|| name.to_owned())
    })
}

#[cfg(all(test, unix))]
mod tests {
    use super::{denied, group_named};

    #[test]
    fn groups_are_found_by_number() {
        let groups = "root:x:0:\nbroken\ndialout:x:20:ada,grace\nplugdev:x:46:\n";
        assert_eq!(group_named(groups, 20).as_deref(), Some("dialout"));
        assert_eq!(group_named(groups, 21), None);
    }

    #[test]
    fn what_to_do_names_the_port() {
        // A file of one's own is in no group that could be joined.
        let file = tempfile::NamedTempFile::new().unwrap();
        let said = denied(file.path());
        assert!(
            said.contains(&format!("ls -l {}", file.path().display())),
            "{said}"
        );
    }
}
