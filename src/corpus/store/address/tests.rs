use super::*;

fn parse(text: &str) -> Result<Address, String> {
    Address::parse(Path::new(text)).map_err(|error| error.to_string())
}

fn objects(service: Service, bucket: &str, prefix: &str) -> Result<Address, String> {
    Ok(Address::Objects { service, bucket: bucket.into(), prefix: prefix.into() })
}

#[test]
fn exact_urls_are_taken_apart_literally() {
    assert_eq!(parse("s3://yard/a/b"), objects(Service::S3, "yard", "a/b"));
    assert_eq!(parse("S3://yard/a/b/"), objects(Service::S3, "yard", "a/b"));
    assert_eq!(parse("gs://my.bucket"), objects(Service::Google, "my.bucket", ""));
    assert_eq!(parse("gs://yard/"), objects(Service::Google, "yard", ""));
    assert_eq!(parse("az://box-1/a%20b/c d@e"), objects(Service::Azure, "box-1", "a%20b/c d@e"));
}

#[test]
fn exact_a_place_within_another_bears_both_names() {
    let within = |place: &str| parse(place).unwrap().join("b");
    assert_eq!(within("corpora/a"), parse("corpora/a/b").unwrap());
    assert_eq!(within("s3://bucket"), parse("s3://bucket/b").unwrap());
    assert_eq!(within("gs://bucket/c/a/"), parse("gs://bucket/c/a/b").unwrap());
}

#[test]
fn exact_what_is_no_url_is_a_folder() {
    for text in ["corpora/x", "/abs", "a:b/c", "s3:/x", "1s://x", "://x", "."] {
        assert_eq!(parse(text), Ok(Address::Folder(text.into())), "{text}");
        assert!(!is_url(Path::new(text)));
    }
}

#[test]
fn exact_file_urls_are_folders_percent_decoded() {
    assert_eq!(parse("file:///tmp/a%20b"), Ok(Address::Folder("/tmp/a b".into())));
    assert_eq!(parse("file://localhost/tmp"), Ok(Address::Folder("/tmp".into())));
    for wrong in ["file://tmp/x", "file:///a%2", "file:///a%zz", "file:///a%00b"] {
        assert!(parse(wrong).unwrap_err().contains("file://"), "{wrong}");
    }
}

#[test]
fn regress_http_is_refused_with_the_way_out() {
    for url in ["https://host/corpus", "http://127.0.0.1:9000/b"] {
        let said = parse(url).unwrap_err();
        assert!(said.contains("AWS_ENDPOINT_URL") && said.contains("s3://"), "{said}");
    }
    assert!(parse("hdfs://x/y").unwrap_err().contains("gs://"));
}

#[test]
fn extreme_urls_with_credentials_are_refused_and_never_repeated() {
    for url in [
        "s3://AKIAKEY:hush@bucket/x",
        "s3://AKIAKEY:hu/hush+@bucket/x",
        "az://box/x?sv=1&sig=hush",
        "gs://hush@bucket",
        "s3://b?hush",
        "https://u:hush@host/x",
        "what://u:hush@host",
        "FILE://u:hush@host/x",
    ] {
        let said = parse(url).unwrap_err();
        assert!(!said.contains("hush") && !said.contains("AKIA"), "{said}");
        assert!(holds_credentials(url) && said.contains("environment"), "{said}");
    }
    assert!(!holds_credentials("s3://bucket/a@b") && !holds_credentials("x?y@z"));
    assert!(!parse("s3://AKIAKEY:hush/x").unwrap_err().contains("hush"));
}

#[test]
fn extreme_names_that_are_none_are_refused() {
    for url in ["s3://", "s3:///x", "s3://b/../x", "s3://b//x", "s3://b/./x", "s3://b/x//", "s3://b\\c/x", "gs://b/a#b"]
    {
        assert!(parse(url).is_err(), "{url}");
    }
}

#[test]
fn exact_a_file_has_a_store_and_a_name() {
    let (store, name) = open_file(Path::new("runs/a/model.safetensors")).unwrap();
    assert_eq!((store.place().as_str(), name.as_str()), ("runs/a", "model.safetensors"));
    assert!(open_file(Path::new("s3://bucket")).is_err());
}

#[test]
fn exact_a_file_url_is_read_within_its_limit() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a b"), b"12345").unwrap();
    let url = PathBuf::from(format!("file://{}/a%20b", dir.path().display()));
    assert_eq!(read_url(&url, 5).unwrap(), b"12345");
    assert!(read_url(&url, 4).unwrap_err().to_string().contains("5 bytes"));
    let gone = PathBuf::from(format!("file://{}/none", dir.path().display()));
    assert!(read_url(&gone, 4).is_err());
}
