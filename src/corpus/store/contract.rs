//! What holds for every store: a folder, and object stores that keep their objects in memory.

use std::sync::Arc;

use super::{LocalFolder, Put, Store};
use crate::corpus::{CorpusError, owner};

/// Runs a check on a fresh store of each kind.
fn each(check: impl Fn(&dyn Store, &str)) {
    let dir = tempfile::tempdir().unwrap();
    // A build's first file lies right in the root and creates it; here others come first.
    std::fs::create_dir(dir.path().join("corpus")).unwrap();
    check(&LocalFolder::new(dir.path().join("corpus")), "a folder");
    #[cfg(feature = "object-stores")]
    {
        use super::objects::ObjectFolder;
        use object_store::memory::InMemory;
        check(&ObjectFolder::new(Arc::new(InMemory::new()), "mem://b", "a/corpus"), "objects in memory");
        check(&ObjectFolder::new(Arc::new(InMemory::new()), "mem://b", ""), "a whole bucket");
    }
}

#[test]
fn law_same_bytes_twice_are_fine_and_other_bytes_are_refused() {
    each(|store, kind| {
        assert_eq!(store.put("data/a", b"one").unwrap(), Put::Created, "{kind}");
        assert_eq!(store.put("data/a", b"one").unwrap(), Put::Same, "{kind}");
        let refused = store.put("data/a", b"two").unwrap_err().to_string();
        assert!(refused.contains("data/a is there already with other bytes"), "{kind}: {refused}");
        assert_eq!(store.read("data/a").unwrap(), b"one", "{kind}");
        store.replace("data/a", b"two").unwrap();
        assert_eq!(store.read("data/a").unwrap(), b"two", "{kind}");
    });
}

#[test]
fn law_of_many_writers_of_one_name_exactly_one_creates_it() {
    each(|store, kind| {
        let created: usize = std::thread::scope(|scope| {
            let writers: Vec<_> = (0..8).map(|_| scope.spawn(|| store.put("data/a", &[7; 100_000]).unwrap())).collect();
            writers.into_iter().map(|w| usize::from(w.join().unwrap() == Put::Created)).sum()
        });
        assert_eq!(created, 1, "{kind}");
        assert_eq!(store.list("data").unwrap(), vec![("data/a".to_string(), 100_000)], "{kind}");
    });
}

#[test]
fn law_of_many_writers_of_other_bytes_all_but_one_are_refused() {
    each(|store, kind| {
        let kept: usize = std::thread::scope(|scope| {
            let put = |byte| move || store.put("data/a", &[byte; 1000]);
            let writers: Vec<_> = (0..8u8).map(|byte| scope.spawn(put(byte))).collect();
            let ends = writers.into_iter().map(|w| w.join().unwrap());
            ends.filter(|end| !matches!(end, Err(CorpusError::Differs { .. }))).map(|end| end.map_or(9, |_| 1)).sum()
        });
        assert_eq!(kept, 1, "{kind}");
        let there = store.read("data/a").unwrap();
        assert!(there.len() == 1000 && there.iter().all(|&byte| byte == there[0]), "{kind}");
    });
}

#[test]
fn exact_ranges_end_with_the_file() {
    each(|store, kind| {
        store.put("a", b"0123456789").unwrap();
        for (offset, length, bytes) in [(3, 4, &b"3456"[..]), (8, 4, b"89"), (0, 10, b"0123456789"), (5, 0, b"")] {
            assert_eq!(store.read_range("a", offset, length).unwrap(), bytes, "{kind}");
        }
        store.put("empty", b"").unwrap();
        assert_eq!((store.read("empty").unwrap().len(), store.size("empty").unwrap()), (0, Some(0)), "{kind}");
    });
}

#[test]
fn exact_listings_hold_the_files_right_in_a_folder_ascending() {
    each(|store, kind| {
        for name in ["data/b", "data/a", "data/deep/c", "database/d", "top"] {
            store.put(name, name.as_bytes()).unwrap();
        }
        let listed = vec![("data/a".to_string(), 6), ("data/b".to_string(), 6)];
        assert_eq!(store.list("data").unwrap(), listed, "{kind}");
        assert_eq!(store.list("none").unwrap(), vec![], "{kind}");
    });
}

#[test]
fn law_a_place_with_anything_in_it_is_not_empty() {
    each(|store, kind| {
        assert_eq!(store.first_entry().unwrap(), None, "{kind}");
        owner::check_empty(store).unwrap();
        store.put("project/deep/main.c", b"mine").unwrap();
        assert!(store.first_entry().unwrap().is_some_and(|name| name.starts_with("project")), "{kind}");
        let refused = owner::check_empty(store).unwrap_err();
        assert!(matches!(refused, CorpusError::Foreign { .. }), "{kind}: {refused}");
    });
}

#[test]
fn exact_bytes_are_added_to_the_end_of_a_file() {
    each(|store, kind| {
        store.put("a", b"one").unwrap();
        store.append("a", b", two").unwrap();
        assert_eq!(store.read("a").unwrap(), b"one, two", "{kind}");
        assert!(store.append("b", b"two").is_err() && store.size("b").unwrap().is_none(), "{kind}");
    });
}

#[test]
fn exact_what_is_not_there_has_no_size_and_is_removed_without_a_word() {
    each(|store, kind| {
        assert_eq!(store.size("b").unwrap(), None, "{kind}");
        store.remove("b").unwrap();
        store.put("b", b"x").unwrap();
        store.remove("b").unwrap();
        assert_eq!(store.size("b").unwrap(), None, "{kind}");
        let gone = store.read("b").unwrap_err();
        let kind_of = |e: &CorpusError| matches!(e, CorpusError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound);
        assert!(kind_of(&gone), "{kind}: {gone}");
        store.sweep_temporaries("data").unwrap();
    });
}

#[test]
fn extreme_names_that_leave_the_place_are_refused() {
    each(|store, kind| {
        for name in ["", "/etc/passwd", "../x", "a/../../x", "a//b", "a/.", "a\\b", "a/"] {
            assert!(matches!(store.put(name, b""), Err(CorpusError::BadName { .. })), "{kind}: {name}");
            assert!(store.read(name).is_err() && store.remove(name).is_err(), "{kind}: {name}");
        }
    });
}

#[test]
fn equal_a_share_is_the_same_store() {
    each(|store, kind| {
        let share: Arc<dyn Store> = store.share();
        store.put("a", b"1").unwrap();
        assert_eq!((share.read("a").unwrap(), share.place()), (b"1".to_vec(), store.place()), "{kind}");
    });
}
