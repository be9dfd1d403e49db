//! What a fresh system lacks: a C++ compiler, the Vulkan loader, a Vulkan driver. Finds out which, and installs them
//! where the package manager is one that we know; elsewhere says what to install.

mod system;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use crate::failure::{Failure, Result};
use crate::workspace;
use system::{Family, System};

/// Something that building or running needs from the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// The image metric of the tests (FLIP) is C++.
    CppCompiler,
    /// `libvulkan`, which finds the drivers.
    VulkanLoader,
    /// A driver; Mesa's works without a GPU.
    VulkanDriver,
}

impl Need {
    fn in_words(self) -> &'static str {
        match self {
            Self::CppCompiler => "a C++ compiler",
            Self::VulkanLoader => "the Vulkan loader",
            Self::VulkanDriver => "a Vulkan driver",
        }
    }

    fn debian_package(self) -> &'static str {
        match self {
            Self::CppCompiler => "g++",
            Self::VulkanLoader => "libvulkan1",
            Self::VulkanDriver => "mesa-vulkan-drivers",
        }
    }
}

/// How to make the system ready.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct SetupOptions {
    /// Install nothing: say what is missing and stop
    #[arg(long)]
    no_install: bool,
}

/// Finds what is missing and installs it, saying so first.
pub fn prepare(options: SetupOptions) -> Result<()> {
    let system = System::detect();
    let missing = missing(&system);
    if missing.is_empty() {
        println!("      compiler and Vulkan files are there");
        return Ok(());
    }
    println!("      missing: {}", words(&missing));
    if missing.contains(&Need::VulkanDriver)
        && let Some(name) = DRIVER_VARIABLES
            .into_iter()
            .find(|name| std::env::var_os(name).is_some_and(|list| !list.is_empty()))
    {
        return Err(Failure::new(format!(
            "{name} is set and names no file that exists; please unset or correct it"
        )));
    }
    install(&system, &missing, options)?;
    let still = self::missing(&System::detect());
    if still.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!(
        "the installation ended well, and yet there is no sign of {}",
        words(&still)
    )))
}

/// Installs Mesa's driver although driver files were found: none of them has a device.
pub fn install_software_driver(options: SetupOptions) -> Result<()> {
    install(
        &System::detect(),
        &[Need::VulkanLoader, Need::VulkanDriver],
        options,
    )
}

/// What a system lacks. Only Linux needs anything that does not come with it or with Rust.
fn missing(system: &System) -> Vec<Need> {
    if !system.linux {
        return Vec::new();
    }
    let mut missing = Vec::new();
    if !system.cpp_compiler {
        missing.push(Need::CppCompiler);
    }
    if !system.vulkan_loader {
        missing.push(Need::VulkanLoader);
    }
    if system.vulkan_drivers.is_empty() {
        missing.push(Need::VulkanDriver);
    }
    missing
}

fn words(needs: &[Need]) -> String {
    needs
        .iter()
        .map(|need| need.in_words())
        .collect::<Vec<_>>()
        .join(", ")
}

fn install(system: &System, needs: &[Need], options: SetupOptions) -> Result<()> {
    let manual = advice(system, needs);
    if options.no_install || system.family != Family::Debian {
        return Err(Failure::new(manual));
    }
    let mut as_root: Vec<&str> = Vec::new();
    if !system.root {
        if !workspace::succeeds(workspace::program("sudo").arg("--version")) {
            return Err(Failure::new(format!(
                "{manual} (this user is not root, and there is no sudo)"
            )));
        }
        as_root.push("sudo");
    }
    println!(
        "      installing through apt: {}",
        packages(needs).join(" ")
    );
    let apt = |words: &[&str]| {
        let command: Vec<&str> = as_root
            .iter()
            .chain(["env", "DEBIAN_FRONTEND=noninteractive", "apt-get"].iter())
            .chain(words)
            .copied()
            .collect();
        println!("      $ {}", command.join(" "));
        workspace::run(workspace::program(command[0]).args(&command[1..]))
    };
    // An index that cannot be refreshed may still be good enough to install from.
    if let Err(failure) = apt(&["update"]) {
        println!("      {failure}; going on with the package index that is there");
    }
    let policy =
        workspace::output(workspace::program("apt-cache").args(["policy", "mesa-vulkan-drivers"]))
            .unwrap_or_default();
    let plan = install_arguments(needs, backports_suite(&policy));
    for arguments in plan {
        apt(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
            .map_err(|failure| Failure::new(format!("{failure}. {manual}")))?;
    }
    Ok(())
}

fn packages(needs: &[Need]) -> Vec<&'static str> {
    needs.iter().map(|need| need.debian_package()).collect()
}

/// The calls of `apt-get`: everything from the system's own release, and Mesa from its backports where those are
/// among the system's sources (on Debian 12 that driver takes a quarter of the stock one's time per frame).
fn install_arguments(needs: &[Need], backports: Option<String>) -> Vec<Vec<String>> {
    let call = |suite: Option<&str>, packages: &[&str]| {
        // Another apt (unattended upgrades after a first boot) is waited for.
        let mut words = vec![
            "-o",
            "DPkg::Lock::Timeout=300",
            "install",
            "--yes",
            "--no-install-recommends",
        ];
        words.extend(
            suite
                .into_iter()
                .flat_map(|suite| ["--target-release", suite]),
        );
        words.extend(packages);
        words.into_iter().map(String::from).collect::<Vec<_>>()
    };
    let (mesa, others): (Vec<Need>, Vec<Need>) =
        needs.iter().partition(|need| **need == Need::VulkanDriver);
    match backports {
        Some(suite) if !mesa.is_empty() => {
            let mut plan = Vec::new();
            if !others.is_empty() {
                plan.push(call(None, &packages(&others)));
            }
            plan.push(call(Some(&suite), &packages(&mesa)));
            plan
        }
        _ => vec![call(None, &packages(needs))],
    }
}

/// Name of a backports suite that offers the package whose `apt-cache policy` this is.
fn backports_suite(policy: &str) -> Option<String> {
    let suites = policy
        .split_whitespace()
        .filter_map(|word| word.split('/').next());
    suites
        .filter(|suite| suite.ends_with("-backports"))
        .map(String::from)
        .next()
}

/// What to install by hand.
fn advice(system: &System, needs: &[Need]) -> String {
    let compiler = needs.contains(&Need::CppCompiler);
    let vulkan = needs.iter().any(|need| *need != Need::CppCompiler);
    let line = |command: &str, compiler_package: &str, vulkan_packages: &str| {
        let mut parts = vec![command];
        parts.extend(compiler.then_some(compiler_package));
        parts.extend(vulkan.then_some(vulkan_packages));
        format!("please install {}: {}", words(needs), parts.join(" "))
    };
    match system.family {
        Family::Debian => format!("please install {}: sudo apt-get install {}", words(needs), packages(needs).join(" ")),
        Family::Fedora => line("sudo dnf install", "gcc-c++", "vulkan-loader mesa-vulkan-drivers"),
        Family::Arch => line("sudo pacman -S", "gcc", "vulkan-icd-loader vulkan-swrast"),
        Family::Suse => line("sudo zypper install", "gcc-c++", "libvulkan1 libvulkan_lvp"),
        Family::Alpine => line("sudo apk add", "g++ musl-dev", "vulkan-loader mesa-vulkan-swrast"),
        Family::Other if system.linux => format!(
            "please install {} with this system's package manager (a C++ compiler such as g++; the Vulkan loader \
             libvulkan; and the GPU's Vulkan driver, or Mesa's software driver lavapipe)",
            words(needs)
        ),
        Family::Other => "please install a graphics driver with Vulkan 1.2 (Windows, Linux) or use a Mac with Metal".into(),
    }
}

/// Where one of these is set, the loader uses the drivers that it lists, and no others.
const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Folders and files in which the Vulkan loader looks for driver manifests, after the loader's documentation
/// ("Driver Discovery on Linux").
fn driver_manifests(variable: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
    for name in DRIVER_VARIABLES {
        if let Some(list) = variable(name).filter(|list| !list.is_empty()) {
            return std::env::split_paths(&list).collect();
        }
    }
    let home = variable("HOME").map(PathBuf::from);
    let in_home = |folder: &str| {
        home.iter()
            .map(|home| home.join(folder))
            .collect::<Vec<_>>()
    };
    let list =
        |name: &str, default: Vec<PathBuf>| match variable(name).filter(|list| !list.is_empty()) {
            Some(list) => std::env::split_paths(&list).collect(),
            None => default,
        };
    let mut folders = list("XDG_CONFIG_HOME", in_home(".config"));
    folders.extend(list("XDG_CONFIG_DIRS", vec!["/etc/xdg".into()]));
    folders.extend(["/usr/local/etc".into(), "/etc".into()]);
    folders.extend(list("XDG_DATA_HOME", in_home(".local/share")));
    folders.extend(list(
        "XDG_DATA_DIRS",
        vec!["/usr/local/share".into(), "/usr/share".into()],
    ));
    folders
        .into_iter()
        .map(|folder| folder.join("vulkan/icd.d"))
        .collect()
}
