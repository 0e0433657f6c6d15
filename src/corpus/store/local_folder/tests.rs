use super::*;

fn folder() -> (tempfile::TempDir, LocalFolder) {
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path().join("corpus"));
    store.put("plan", b"").unwrap();
    (dir, store)
}

#[test]
fn law_of_many_writers_of_one_name_exactly_one_creates_it() {
    let (_dir, store) = folder();
    let created: usize = std::thread::scope(|scope| {
        let writers: Vec<_> = (0..8).map(|_| scope.spawn(|| store.put("data/a", &[7; 100_000]).unwrap())).collect();
        writers.into_iter().map(|w| usize::from(w.join().unwrap() == Put::Created)).sum()
    });
    assert_eq!(created, 1);
    assert_eq!(store.list("data").unwrap(), vec![("data/a".to_string(), 100_000)]);
    assert_eq!(fs::read_dir(store.root.join("data")).unwrap().count(), 1, "no temporary file stays");
}

#[test]
fn law_what_a_killed_writer_leaves_is_never_taken_for_whole() {
    let (_dir, store) = folder();
    store.put("data/a", b"whole").unwrap();
    fs::write(store.root.join("data/.marsyard-tmp-4711-x1"), b"half").unwrap();
    assert_eq!(store.list("data").unwrap(), vec![("data/a".to_string(), 5)]);
    assert!(store.read("data/.marsyard-tmp-4711-x1").is_err());
    store.sweep_temporaries("data").unwrap();
    assert_eq!(fs::read_dir(store.root.join("data")).unwrap().count(), 1);
}

#[test]
fn law_the_temporary_files_of_a_live_writer_are_never_swept() {
    let (_dir, store) = folder();
    store.put("data/a", b"whole").unwrap();
    let live = locked_temporary(&store.root.join("data")).unwrap();
    fs::write(store.root.join("data/.marsyard-tmp-1-dead"), b"half").unwrap();
    fs::write(store.root.join(".marsyard-tmp-1-dead"), b"half").unwrap();
    store.sweep_temporaries("data").unwrap();
    store.sweep_temporaries("").unwrap();
    assert!(live.path().exists() && !store.root.join("data/.marsyard-tmp-1-dead").exists());
    assert!(!store.root.join(".marsyard-tmp-1-dead").exists());
    let abandoned = live.path().to_path_buf();
    // The lock ends with the file's handle, as it does with the process.
    let (handle, path) = live.keep().unwrap();
    drop(handle);
    assert_eq!(path, abandoned);
    store.sweep_temporaries("data").unwrap();
    assert!(!abandoned.exists());
}

#[test]
fn law_writers_and_sweepers_at_once_lose_nothing() {
    let (_dir, store) = folder();
    let over = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        let sweeper = scope.spawn(|| {
            while !over.load(std::sync::atomic::Ordering::Relaxed) {
                store.sweep_temporaries("data").unwrap();
            }
        });
        let puts: Vec<_> = (0..200).map(|k| store.put(&format!("data/{k}"), &[k as u8; 1000])).collect();
        over.store(true, std::sync::atomic::Ordering::Relaxed);
        sweeper.join().unwrap();
        assert!(puts.into_iter().all(|put| put.unwrap() == Put::Created));
    });
    assert_eq!(store.list("data").unwrap().len(), 200);
}

#[test]
fn law_a_place_says_what_is_free_and_whether_it_can_be_written() {
    let (_dir, store) = folder();
    assert!(store.free_bytes().unwrap().unwrap() > 0);
    store.probe().unwrap();
    assert_eq!(fs::read_dir(&store.root).unwrap().count(), 1, "the probe is gone");
    fs::remove_dir_all(&store.root).unwrap();
    assert!(store.put("data/a", b"x").is_err() && !store.root.exists(), "what has gone away is not made again");
    fs::write(&store.root, b"a file").unwrap();
    assert!(matches!(store.probe(), Err(CorpusError::Io { .. })));
}

#[test]
fn regress_a_folder_that_another_build_makes_meanwhile_is_no_broken_link() {
    let (dir, store) = folder();
    store.refuse_broken_link().unwrap();
    let made = LocalFolder::new(dir.path().join("made"));
    std::thread::scope(|scope| {
        let looks = scope.spawn(|| (0..20_000).map(|_| made.first_entry()).collect::<Result<Vec<_>, _>>());
        while !looks.is_finished() {
            fs::create_dir(&made.root).unwrap();
            fs::remove_dir(&made.root).unwrap();
        }
        looks.join().unwrap().expect("each look finds nothing or an empty folder");
    });
    let link = LocalFolder::new(dir.path().join("link"));
    std::os::unix::fs::symlink(&made.root, &link.root).unwrap();
    let broken = link.first_entry().unwrap_err().to_string();
    assert!(broken.contains("a link to a folder that is not there"), "{broken}");
}

#[test]
fn extreme_files_are_read_within_their_limit_and_devices_not_at_all() {
    let (_dir, store) = folder();
    store.put("a", b"12345").unwrap();
    assert_eq!(store.read_within("a", 5).unwrap(), b"12345");
    let long = store.read_within("a", 4).unwrap_err().to_string();
    assert!(long.contains("it has 5 bytes, more than the 4"), "{long}");
    std::os::unix::fs::symlink("/dev/zero", store.root.join("zero")).unwrap();
    fs::create_dir(store.root.join("folder")).unwrap();
    for (name, expected) in [("zero", "a link"), ("folder", "a folder")] {
        let refused = store.read(name).unwrap_err();
        assert!(matches!(refused, CorpusError::NotAFile { what, .. } if what == expected), "{refused}");
    }
    let device = LocalFolder::new("/dev").read("zero").unwrap_err();
    assert!(matches!(device, CorpusError::NotAFile { .. }), "{device}");
}

#[test]
fn extreme_a_file_that_cannot_be_read_is_replaced_by_one_of_its_length() {
    let (_dir, store) = folder();
    store.put("a", b"old").unwrap();
    fs::set_permissions(store.root.join("a"), Permissions::from_mode(0o000)).unwrap();
    store.replace("a", b"new").unwrap();
    assert_eq!(store.read("a").unwrap(), b"new");
}

#[test]
fn law_others_may_read_what_is_written() {
    let (_dir, store) = folder();
    store.put("a", b"x").unwrap();
    let plain = store.root.join("plain");
    fs::write(&plain, b"x").unwrap();
    let mode = |path: PathBuf| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(store.root.join("a")), mode(plain));
}
