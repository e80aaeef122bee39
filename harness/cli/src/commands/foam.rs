//! The options of `harness export` that only meshes for OpenFOAM have.

use super::values::read_case;
use clap::Args;
use contract::case::Case;
use contract::failure::Failure;
use export::options::{Foam, Label, Processors, Regions};

/// Options of meshes for OpenFOAM.
#[derive(Args, Debug)]
#[command(next_help_heading = "OpenFOAM (CASE/constant/polyMesh)")]
pub struct FoamArguments {
    /// Bits of a label [default: 32]
    #[arg(long, value_name = "BITS")]
    label: Option<Label>,
    /// Regions of cells that no face connects [default: all]
    #[arg(long)]
    regions: Option<Regions>,
    /// Write directories processor0 to processorN-1 instead: N equal intervals of the Morton curve, or `ranks` of the mesher
    #[arg(long, value_name = "N|ranks", value_parser = processors)]
    processors: Option<Processors>,
    /// The case that was meshed, whose named solids become patches: name in geometries/catalogue.toml or path of a case file
    #[arg(long, value_name = "CASE")]
    case: Option<String>,
}

impl FoamArguments {
    /// Reads the case, if one is given.
    ///
    /// # Errors
    /// If the case cannot be read, or if an option has no effect on the format with this ending.
    pub fn case(&self, ending: &str) -> Result<Option<Case>, Failure> {
        let Self { label, regions, processors, case } = self;
        let given = [
            ("--label", label.is_some()),
            ("--regions", regions.is_some()),
            ("--processors", processors.is_some()),
            ("--case", case.is_some()),
        ];
        let has_effect = |name: &str| match ending {
            "/polyMesh" => true,
            ".cgns" => ["--regions", "--case"].contains(&name),
            _ => false,
        };
        if let Some((name, _)) =
            given.iter().find(|(name, is_given)| *is_given && !has_effect(name))
        {
            return Err(Failure::input(format!(
                "{name} has no effect on {ending}: omit it, or write CASE/constant/polyMesh"
            )));
        }
        case.as_deref().map(read_case).transpose()
    }

    /// The options, with the case that they name.
    pub fn options<'a>(&self, case: Option<&'a Case>) -> Foam<'a> {
        Foam {
            label: self.label.unwrap_or_default(),
            regions: self.regions.unwrap_or_default(),
            processors: self.processors,
            case,
        }
    }
}

fn processors(processors: &str) -> Result<Processors, String> {
    match processors.parse() {
        Ok(count) if count > 0 => Ok(Processors::Equal(count)),
        _ if processors == "ranks" => Ok(Processors::Ranks),
        _ => Err("give a positive number, or ranks".to_owned()),
    }
}
