//! Writes the files of `stl-files.txt` into an existing directory: `cargo run -p geometries --example stl_files -- DIR`.

fn main() -> std::io::Result<()> {
    let Some(directory) = std::env::args_os().nth(1) else {
        panic!("give an existing directory");
    };
    for file in geometries::stl_files() {
        std::fs::write(std::path::Path::new(&directory).join(&file.name), &file.bytes)?;
    }
    Ok(())
}
