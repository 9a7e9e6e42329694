//! What a `uri` points to: bytes within the URI itself (RFC 2397), or a file beside the model (RFC 3986).

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::formats::surroundings::Surroundings;

/// A URI, read.
#[derive(Debug, PartialEq)]
pub(super) enum Target {
    /// The decoded bytes of a data URI.
    Data(Vec<u8>),
    /// A file, joined to the model's folder.
    File(PathBuf),
}

/// Reads a URI of a model.
///
/// # Errors
/// A file's error for data that is not valid base64 or percent encoding; unsupported for other schemes, such as `http:`; a
/// limit for too much data; a file's error for a file that the model must not read.
pub(super) fn resolve(uri: &str, surroundings: &Surroundings) -> Result<Target> {
    if let Some(data) = strip_scheme(uri, "data") {
        let (media_type, payload) =
            data.split_once(',').ok_or_else(|| Error::file("the data URI has no comma before its data"))?;
        let is_base64 = media_type.rsplit(';').next().is_some_and(|last| last.trim().eq_ignore_ascii_case("base64"));
        let length = payload.len() as u64;
        surroundings.limits.check_data_uri_bytes(if is_base64 { length / 4 * 3 } else { length })?;
        let bytes = percent_decode(payload)?;
        return Ok(Target::Data(if is_base64 { base64_decode(&bytes)? } else { bytes }));
    }
    if let Some(scheme) = scheme(uri) {
        return Err(Error::unsupported(format!("URIs of the kind `{scheme}:` are not read"))
            .remedy("put the file beside the model and name it there"));
    }
    let name = String::from_utf8(percent_decode(uri)?)
        .map_err(|_| Error::file(format!("the URI `{uri}` is not UTF-8 once decoded")))?;
    // Some exporters write Windows paths; a file that really has the backslash in its name goes first.
    let path = surroundings.folder.join(&name);
    let portable = surroundings.folder.join(name.replace('\\', "/"));
    surroundings.check(&portable, &name)?;
    Ok(Target::File(if path.exists() { path } else { portable }))
}

/// The scheme of an absolute URI. One letter is a Windows drive, not a scheme.
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let valid = |c: char| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.');
    (scheme.len() > 1 && scheme.starts_with(|c: char| c.is_ascii_alphabetic()) && scheme.chars().all(valid))
        .then_some(scheme)
}

fn strip_scheme<'a>(uri: &'a str, wanted: &str) -> Option<&'a str> {
    let scheme = scheme(uri)?;
    scheme.eq_ignore_ascii_case(wanted).then(|| &uri[scheme.len() + 1..])
}

/// Replaces `%41` by `A`. A percent sign without two hexadecimal digits stays: files have such names.
fn percent_decode(text: &str) -> Result<Vec<u8>> {
    let bytes = text.as_bytes();
    let digit = |at: usize| bytes.get(at).and_then(|&byte| char::from(byte).to_digit(16));
    let mut decoded = Vec::new();
    decoded.try_reserve_exact(bytes.len()).map_err(|_| Error::limit("not enough memory for a data URI"))?;
    let mut at = 0;
    while at < bytes.len() {
        match (bytes[at], digit(at + 1), digit(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    Ok(decoded)
}

/// Decodes base64 (RFC 4648, section 4): standard alphabet, nothing between; padding may be absent, but not wrong.
fn base64_decode(text: &[u8]) -> Result<Vec<u8>> {
    let unpadded = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    if unpadded.len() < text.len() && !text.len().is_multiple_of(4) {
        return Err(Error::file("the base64 data of the data URI is cut off"));
    }
    let mut decoded = Vec::with_capacity(unpadded.len() / 4 * 3 + 2);
    for (group_number, group) in unpadded.chunks(4).enumerate() {
        let mut bits = 0u32;
        for (place, &byte) in group.iter().enumerate() {
            let value = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => {
                    let at = group_number * 4 + place;
                    return Err(Error::file(format!("the data URI has byte 0x{byte:02x} at {at} of its base64 data")));
                }
            };
            bits |= u32::from(value) << (18 - 6 * place);
        }
        let [_, bytes @ ..] = bits.to_be_bytes();
        let whole = match group.len() {
            4 => 3,
            3 => 2,
            2 => 1,
            _ => return Err(Error::file("the base64 data of the data URI is cut off")),
        };
        decoded.extend_from_slice(&bytes[..whole]);
    }
    Ok(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{Limits, LoadOptions};
    use std::path::Path;

    fn resolve(uri: &str, folder: &Path) -> Result<Target> {
        super::resolve(uri, &Surroundings::new(folder, &LoadOptions::default()))
    }

    fn data(uri: &str) -> Vec<u8> {
        match resolve(uri, Path::new("folder")).unwrap() {
            Target::Data(bytes) => bytes,
            Target::File(path) => panic!("{path:?}"),
        }
    }

    #[test]
    fn base64_follows_the_test_vectors_of_rfc_4648() {
        for (encoded, plain) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(data(&format!("data:application/octet-stream;base64,{encoded}")), plain.as_bytes());
            assert_eq!(base64_decode(encoded.trim_end_matches('=').as_bytes()).unwrap(), plain.as_bytes());
        }
        assert_eq!(base64_decode(b"+/+/").unwrap(), [0xfb, 0xff, 0xbf]);
        for bad in ["Zg=", "Z", "Z===", "Zm9v!", "Zm 9v", "Zg==Zg==", "Zm9v\n"] {
            assert!(base64_decode(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    #[test]
    fn files_lie_beside_the_model() {
        let file = |uri| resolve(uri, Path::new("folder")).unwrap();
        assert_eq!(file("a%20b.bin"), Target::File("folder/a b.bin".into()));
        assert_eq!(file("100%.bin"), Target::File("folder/100%.bin".into()));
        assert_eq!(file("maps\\wood.png"), Target::File("folder/maps/wood.png".into()));
        assert_eq!(data("DATA:,a%41"), b"aA");
        assert!(resolve("https://example.org/a.bin", Path::new("")).is_err());
        assert!(resolve("data:application/octet-stream;base64", Path::new("")).is_err());
    }

    #[test]
    fn files_elsewhere_are_refused_unless_allowed() {
        for uri in ["../a.bin", "%2e%2e/a.bin", "..\\a.bin", "/etc/a.bin", "b/../../a.bin"] {
            let error = resolve(uri, Path::new("folder")).unwrap_err();
            assert!(error.to_string().contains("--allow-external"), "{uri}: {error}");
            let options = LoadOptions { allow_external: true, ..Default::default() };
            assert!(super::resolve(uri, &Surroundings::new(Path::new("folder"), &options)).is_ok(), "{uri}");
        }
    }

    #[test]
    fn data_beyond_the_limit_is_not_decoded() {
        let limits = Limits { data_uri_bytes: 6, ..Limits::default() };
        let surroundings = Surroundings { limits, ..Default::default() };
        assert!(super::resolve("data:;base64,Zm9vYmFy", &surroundings).is_ok());
        let error = super::resolve("data:;base64,Zm9vYmFyZm9v", &surroundings).unwrap_err();
        assert!(error.to_string().ends_with("raise it with `--limit data-uri-bytes=9`"), "{error}");
    }
}
