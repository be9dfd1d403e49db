use super::system::{family, manifests};
use super::*;

fn complete() -> System {
    System {
        linux: true,
        family: Family::Debian,
        root: true,
        cpp_compiler: true,
        vulkan_loader: true,
        vulkan_drivers: vec!["lvp_icd.json".into()],
    }
}

#[test]
fn each_missing_thing_is_named() {
    assert_eq!(missing(&complete()), []);
    let bare = System {
        cpp_compiler: false,
        vulkan_loader: false,
        vulkan_drivers: Vec::new(),
        ..complete()
    };
    assert_eq!(
        missing(&bare),
        [Need::CppCompiler, Need::VulkanLoader, Need::VulkanDriver]
    );
    assert_eq!(
        missing(&System {
            vulkan_drivers: Vec::new(),
            ..complete()
        }),
        [Need::VulkanDriver]
    );
    assert_eq!(
        missing(&System {
            linux: false,
            ..bare
        }),
        [],
        "other systems bring what is needed"
    );
}

#[test]
fn systems_are_told_apart() {
    for (text, expected) in [
        (
            "PRETTY_NAME=\"Debian GNU/Linux 12 (bookworm)\"\nID=debian\n",
            Family::Debian,
        ),
        (
            "NAME=\"Ubuntu\"\nID=ubuntu\nID_LIKE=debian\n",
            Family::Debian,
        ),
        ("ID=linuxmint\nID_LIKE=\"ubuntu debian\"\n", Family::Debian),
        (
            "ID=\"rocky\"\nID_LIKE=\"rhel centos fedora\"\n",
            Family::Fedora,
        ),
        ("ID=manjaro\nID_LIKE=arch\n", Family::Arch),
        (
            "ID=\"opensuse-tumbleweed\"\nID_LIKE=\"opensuse suse\"\n",
            Family::Suse,
        ),
        ("ID=nixos\n", Family::Other),
        ("", Family::Other),
    ] {
        assert_eq!(family(text), expected, "{text}");
    }
}

#[test]
fn advice_names_packages_of_the_system() {
    let needs = [Need::CppCompiler, Need::VulkanDriver];
    for (family, expected) in [
        (Family::Debian, "apt-get install g++ mesa-vulkan-drivers"),
        (
            Family::Fedora,
            "dnf install gcc-c++ vulkan-loader mesa-vulkan-drivers",
        ),
        (
            Family::Arch,
            "pacman -S gcc vulkan-icd-loader vulkan-swrast",
        ),
        (Family::Other, "lavapipe"),
    ] {
        let advice = advice(
            &System {
                family,
                ..complete()
            },
            &needs,
        );
        assert!(advice.contains(expected), "{family:?}: {advice}");
    }
    let compiler_only = advice(
        &System {
            family: Family::Fedora,
            ..complete()
        },
        &[Need::CppCompiler],
    );
    assert!(!compiler_only.contains("vulkan"), "{compiler_only}");
}

#[test]
fn nothing_is_installed_against_the_users_will_or_on_unknown_systems() {
    let refused = install(
        &complete(),
        &[Need::VulkanDriver],
        SetupOptions { no_install: true },
    );
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("mesa-vulkan-drivers")
    );
    let fedora = System {
        family: Family::Fedora,
        ..complete()
    };
    assert!(
        install(
            &fedora,
            &[Need::VulkanDriver],
            SetupOptions { no_install: false }
        )
        .is_err()
    );
}

#[test]
fn mesa_comes_from_backports_where_they_are_configured() {
    let policy = "mesa-vulkan-drivers:\n  Installed: (none)\n  Candidate: 22.3.6-1\n  Version table:\n     \
                  25.0.7-2~bpo12+1 100\n        100 http://mirror/debian bookworm-backports/main amd64 Packages\n     \
                  22.3.6-1 500\n        500 http://mirror/debian bookworm/main amd64 Packages\n";
    let suite = backports_suite(policy);
    assert_eq!(suite.as_deref(), Some("bookworm-backports"));
    let plan = install_arguments(&[Need::CppCompiler, Need::VulkanDriver], suite);
    assert_eq!(plan.len(), 2, "{plan:?}");
    assert!(
        plan[0].ends_with(&["g++".into()]) && !plan[0].contains(&"--target-release".into()),
        "{plan:?}"
    );
    assert!(plan[1].ends_with(&[
        "--target-release".into(),
        "bookworm-backports".into(),
        "mesa-vulkan-drivers".into()
    ]));

    let stock =
        "     24.2.8 500\n        500 http://mirror/ubuntu noble-updates/main amd64 Packages\n";
    assert_eq!(backports_suite(stock), None);
    assert_eq!(
        install_arguments(&[Need::VulkanLoader, Need::VulkanDriver], None).len(),
        1
    );
}

#[test]
fn drivers_are_looked_for_where_the_loader_does() {
    let folder = tempfile::tempdir().unwrap();
    let icd = folder.path().join("share/vulkan/icd.d");
    std::fs::create_dir_all(&icd).unwrap();
    let share = folder.path().join("share").display().to_string();
    let places = driver_manifests(|name| (name == "XDG_DATA_DIRS").then(|| share.clone()));
    assert!(
        places.contains(&icd) && places.contains(&"/etc/vulkan/icd.d".into()),
        "{places:?}"
    );
    assert_eq!(manifests(std::slice::from_ref(&icd)), Vec::<PathBuf>::new());
    std::fs::write(icd.join("readme.txt"), "").unwrap();
    let manifest = icd.join("lvp.json");
    std::fs::write(&manifest, "{}").unwrap();
    assert_eq!(
        manifests(&places)
            .iter()
            .filter(|path| **path == manifest)
            .count(),
        1
    );

    let explicit =
        driver_manifests(|name| (name == "VK_ICD_FILENAMES").then(|| "/nowhere/a.json".into()));
    assert_eq!(explicit, [PathBuf::from("/nowhere/a.json")]);
    assert!(
        manifests(&explicit).is_empty(),
        "a manifest that does not exist"
    );
}
