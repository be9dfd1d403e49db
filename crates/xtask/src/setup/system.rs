//! What is known of the system, gathered once.

use std::path::{Path, PathBuf};

use crate::workspace;

/// Systems that install packages the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    Debian,
    Fedora,
    Arch,
    Suse,
    Alpine,
    Other,
}

/// Facts about the system.
#[derive(Clone, Debug)]
pub struct System {
    pub linux: bool,
    pub family: Family,
    /// Whether this user may install packages without further ado.
    pub root: bool,
    pub cpp_compiler: bool,
    pub vulkan_loader: bool,
    /// Manifests of Vulkan drivers. A manifest is no proof of a device: that is for `akari doctor` to find out.
    pub vulkan_drivers: Vec<PathBuf>,
}

impl System {
    pub fn detect() -> Self {
        let linux = cfg!(target_os = "linux");
        let release = ["/etc/os-release", "/usr/lib/os-release"]
            .into_iter()
            .find_map(|path| std::fs::read_to_string(path).ok());
        // The variable that the build script of the C++ code obeys, too.
        let compiler = std::env::var_os("CXX").unwrap_or_else(|| "c++".into());
        Self {
            linux,
            family: if linux {
                family(&release.unwrap_or_default())
            } else {
                Family::Other
            },
            root: workspace::output(workspace::program("id").arg("-u"))
                .is_ok_and(|user| user.trim() == "0"),
            cpp_compiler: workspace::succeeds(workspace::program(compiler).arg("--version")),
            vulkan_loader: has_vulkan_loader(),
            vulkan_drivers: manifests(&super::driver_manifests(|name| std::env::var(name).ok())),
        }
    }
}

/// Family of a system by its `os-release` file: its own name first, then those it says it is like.
pub fn family(os_release: &str) -> Family {
    let value = |key: &str| {
        let line = os_release
            .lines()
            .find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        line.unwrap_or_default()
            .trim_matches(['"', '\''])
            .to_ascii_lowercase()
    };
    let names = format!("{} {}", value("ID"), value("ID_LIKE"));
    let known = names.split_whitespace().find_map(|name| match name {
        "debian" | "ubuntu" => Some(Family::Debian),
        "fedora" | "rhel" | "centos" => Some(Family::Fedora),
        "arch" => Some(Family::Arch),
        "suse" | "opensuse" => Some(Family::Suse),
        "alpine" => Some(Family::Alpine),
        _ => None,
    });
    known.unwrap_or(Family::Other)
}

/// Whether the dynamic linker would find the Vulkan loader.
fn has_vulkan_loader() -> bool {
    const LOADER: &str = "libvulkan.so.1";
    // Not on the path of ordinary users on Debian.
    let cached = ["ldconfig", "/sbin/ldconfig"].into_iter().any(|name| {
        workspace::quiet_output(workspace::program(name).arg("-p"))
            .is_some_and(|list| list.contains(LOADER))
    });
    let extra = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    // Systems without glibc have no cache to ask.
    let plain = ["/usr/lib", "/usr/lib64", "/usr/local/lib", "/lib"].map(PathBuf::from);
    cached
        || std::env::split_paths(&extra)
            .chain(plain)
            .any(|folder| folder.join(LOADER).exists())
}

/// The manifests in the given folders, and those of the given paths that are files themselves.
pub fn manifests(places: &[PathBuf]) -> Vec<PathBuf> {
    let is_manifest = |path: &Path| {
        path.is_file()
            && path
                .extension()
                .is_some_and(|extension| extension == "json")
    };
    let inside = |place: &PathBuf| -> Vec<PathBuf> {
        if place.is_file() {
            return vec![place.clone()];
        }
        std::fs::read_dir(place)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .collect()
    };
    let mut found: Vec<PathBuf> = places
        .iter()
        .flat_map(inside)
        .filter(|path| is_manifest(path))
        .collect();
    found.sort();
    found.dedup();
    found
}
