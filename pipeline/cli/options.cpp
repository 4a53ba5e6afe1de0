// The only file that knows CLI11; its exceptions stop here.
#include "pipeline/cli/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <limits>
#include <sstream>

#include "formats/shader_package.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/sample_btf.h"
#include "pipeline/jobs/sample_set.h"

namespace patina {
namespace {

constexpr const char* kExamples =
    "Examples:\n"
    "  patina sample --out sample                       make input to try things with\n"
    "  patina bake sample --out baked                   bake a folder of maps\n"
    "  patina bake textures/* --out baked --quality preview\n"
    "  patina bake wall --out baked --profile bcf-2k --min-psnr 30\n"
    "  patina bake scene.glb --out baked                every material of a glTF scene\n"
    "  patina bake chrome.binary steel.bsdf --out baked bake measured BRDFs\n"
    "  patina info baked/sample                         what a container holds and how good it is\n"
    "  patina view baked/sample                         look at it in the browser, lit\n"
    "  patina unpack baked/sample --out maps            the maps back as images\n"
    "  patina compare baked/sample sample               measure a container against its source "
    "again\n"
    "  patina eval baked/chrome --pairs pairs.csv       values of a BRDF\n"
    "  patina tradeoff wall --out sweep                 what accuracy costs in time and bytes\n"
    "  patina shader baked/wall --out shaders           what a GPU needs to decode it\n"
    "  patina pack baked/wall -o wall.patina            a container as one file\n"
    "  patina validate baked                            check all of them, for CI\n"
    "  patina submit textures/wall --wait               the same by a daemon (see patinad --help)\n"
    "\n"
    "`patina COMMAND --help` explains a command. Exit codes: 0 done, 1 failed, 2 wrong usage, 3 "
    "bad input,\n"
    "4 below the quality gate, 130 interrupted.";

constexpr const char* kBakeFooter =
    "INPUT is a folder of maps (found by their file names), a measured BRDF (MERL .binary, RGL "
    ".bsdf, UTIA .bin, a\n"
    "list of measurements as .csv or .json), a layered material to simulate (*.layers.json, see\n"
    "schemas/layered.schema.json), a set of measured images under many lights and views\n"
    "(*.btf.json, see schemas/image-set.schema.json), a folder of all these or of such folders, or "
    "a job file (see\n"
    "schemas/job.schema.json), whose fields the options replace. One asset that fails does not "
    "stop the others; the exit\n"
    "code is that of the worst. The result is OUT/<asset>/<revision>/ with OUT/<asset>/current "
    "pointing at it. A BRDF's\n"
    "asset has the name of its file. [maps] marks options that BRDFs do not have.\n"
    "\n"
    "Examples:\n"
    "  patina bake sample --out baked\n"
    "  patina bake library --out baked --quality preview --json\n"
    "  patina bake merl/*.binary brushed.bsdf --out baked\n"
    "  patina bake layered/car_paint.layers.json --out baked --quality reference\n"
    "  patina bake cloth/cloth.btf.json --out baked    a spatially varying BRDF\n"
    "  patina bake lacquer/lacquer.layers.json --out baked            likewise, where layers have "
    "maps\n"
    "  patina bake wall scene.glb --out baked --as svbrdf             reflectance of texture sets\n"
    "  patina bake wall --out baked --maps wall.maps.json --normal-convention directx\n"
    "  patina bake wall --out baked --target-psnr 32                  the smallest that reaches "
    "it\n"
    "  patina bake wall --out baked --size-budget 400k --time-budget 60\n"
    "\n"
    "The colour space of a colour map is what the map list says; else --color-space; else a word "
    "of "
    "the file's name\n"
    "(linear, srgb, raw); else what the file says (ICC profile, PNG chunks, EXR chromaticities); "
    "else a file rule of the\n"
    "configuration; else sRGB for integers, linear Rec.709 for floats. Data maps are never "
    "converted.\n"
    "\n"
    "A map list (--maps) is a JSON array with files relative to its own folder, such as\n"
    "  [{\"role\": \"albedo\", \"file\": \"wall_c.png\"},\n"
    "   {\"role\": \"roughness\", \"file\": \"wall_gloss.png\", \"channels\": \"r\", \"invert\": "
    "true}]";

void AddCommon(CLI::App* command, CommandLine* line, bool with_json) {
  if (with_json)
    command->add_flag("--json", line->json,
                      "Print the result as JSON, the last line of standard output");
  command->add_flag_callback(
      "-q,--quiet", [line] { line->verbosity = Verbosity::kQuiet; }, "No progress, warnings only");
  command->add_flag_callback(
      "-v,--verbose", [line] { line->verbosity = Verbosity::kVerbose; },
      "Also what was found and how long each stage took");
  command
      ->add_option("--simd", line->simd,
                   "Instruction set of the kernels; does not change the result")
      ->check(CLI::IsMember({"auto", "avx2", "avx512"}));
}

// CLI::Range lets NaN pass.
CLI::Range FiniteRange(double low, double high) {
  CLI::Range range(low, high);
  CLI::Validator& check = range;
  check.operation([low, high](std::string& text) {
    double value = 0;
    if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high)
      return std::string();
    std::ostringstream out;
    out << "Value " << text << " not in range " << low << " to " << high;
    return out.str();
  });
  return range;
}

template <class T>
CLI::Option* AddOverride(CLI::App* command, const std::string& name, std::optional<T>* value,
                         const std::string& help) {
  return command
      ->add_option_function<T>(
          name, [value](const T& given) { *value = given; }, help)
      ->take_last();
}

void AddAs(CLI::App* command, const std::string& otherwise, std::string* as) {
  command
      ->add_option("--as", *as,
                   "[maps] What texture sets and materials of scenes become: a material (default" +
                       otherwise +
                       "), which has their channels; or svbrdf, the reflectance that follows from "
                       "them, filtered as such")
      ->check(CLI::IsMember({"material", "svbrdf"}));
}

void AddBake(CLI::App* app, CommandLine* line) {
  CLI::App* command =
      app->add_subcommand("bake", "Bake texture sets, scenes and measured BRDFs into containers");
  BakeOptions& o = line->bake;
  command
      ->add_option("INPUT", o.inputs,
                   "Folders of maps, BRDF files, scenes (.gltf, .glb, .patina.json), folders of "
                   "these, job files")
      ->required();
  AddOverride(command, "-o,--out", &o.job.out,
              "Folder for the containers (needed unless every INPUT is a job file)")
      ->type_name("DIR");
  AddOverride(
      command, "--profile", &o.job.profile,
      "[maps] Size of the feature textures: 1/4, 1/2 (default) or 1 x the side of the source; auto "
      "(default with a target or a size): the smallest that reaches the target, or the largest "
      "that fits")
      ->check(CLI::IsMember({"auto", "bcf-0.5k", "bcf-1k", "bcf-2k", "bcf-2k++"}));
  AddAs(command, "", &o.as);
  AddOverride(command, "--quality", &o.job.quality, "How long to train (default standard)")
      ->check(CLI::IsMember({"preview", "standard", "reference"}));
  AddOverride(command, "--target-psnr", &o.job.target_psnr_db,
              "[maps] PSNR of mip 0 that the files have to reach, in dB: stop once it is there; "
              "publish nothing below it, and exit with 4")
      ->check(FiniteRange(0.0, 100.0))
      ->type_name("DB");
  AddOverride(command, "--target-bpp", &o.job.target_bpp,
              "[maps] Most bits for each texel of mip 0, of all that an engine loads")
      ->check(FiniteRange(0.0, 1024.0))
      ->type_name("BITS");
  AddOverride(command, "--size-budget", &o.job.size_budget_bytes,
              "[maps] Most bytes that an engine loads; 300k and 2M are understood")
      ->transform(CLI::AsSizeValue(true))
      ->check(CLI::Range(uint64_t{1}, kMaxSizeBudget))
      ->type_name("BYTES");
  AddOverride(command, "--time-budget", &o.job.time_budget_s,
              "[maps] Aim to be done within so many seconds; the result then depends on the "
              "machine's speed")
      ->check(FiniteRange(0.0, 1e6))
      ->type_name("S");
  AddOverride(
      command, "--min-psnr", &o.job.min_psnr_db,
      "[maps] Quality gate: publish nothing below this overall PSNR, in dB, and exit with 4")
      ->check(FiniteRange(0.0, 100.0))
      ->type_name("DB");
  AddOverride(command, "--recipe", &o.job.recipe,
              "How to train: ours (default), or as the papers do (Weinreich 2024, Dou 2023)")
      ->check(CLI::IsMember({"patina", "paper"}));
  command
      ->add_option("--share", o.share,
                   "[BRDFs] Train up to N BRDF files that look alike on one codebook: smaller "
                   "containers, a little less exact (default 1: each its own)")
      ->check(CLI::Range(1, 64))
      ->type_name("N");
  AddOverride(command, "--texture-format", &o.job.texture_format,
              "[spatially varying BRDFs] What the neural texture is stored as: bc6h (default), or "
              "fp16, uncompressed, which is eight times as large and a little more exact")
      ->check(CLI::IsMember({"bc6h", "fp16"}));
  AddOverride(command, "--samples", &o.job.samples,
              "[maps] Train with exactly so many samples, in place of --quality's choice")
      ->check(FiniteRange(0.0, 1e12))
      ->type_name("N");
  AddOverride(command, "--seed", &o.job.seed, "Seed of every random choice (default 1)")
      ->check(CLI::Range(uint64_t{0}, kMaxSeed))
      ->type_name("N");
  command->add_flag("--no-report", o.job.no_report,
                    "Write no report.html, the page about quality, bytes and time");
  AddOverride(command, "--threads", &o.job.threads,
              "Threads (default: all CPUs); does not change the result")
      ->check(CLI::Range(0, kMaxThreads))
      ->type_name("N");
  command
      ->add_option("--maps", o.map_list,
                   "[maps] List of the maps of the one INPUT, in place of finding them by name")
      ->type_name("FILE.json");
  AddOverride(command, "--normal-convention", &o.job.normal_convention,
              "[maps] Y of normal maps: up (opengl) or down (directx); default by name and content")
      ->check(CLI::IsMember({"auto", "opengl", "directx"}));
  AddOverride(command, "--address", &o.job.address,
              "[maps] What lies beyond the edge (default wrap, for tiling maps)")
      ->check(CLI::IsMember({"wrap", "clamp"}));
  AddOverride(command, "--working-space", &o.job.working_space,
              "[maps] Primaries of the container's physical colours (default lin_rec709)")
      ->check(CLI::IsMember({"lin_rec709", "acescg"}));
  AddOverride(command, "--color-space", &o.job.color_space,
              "[maps] Colour space of the colour maps: srgb, linear, raw, or a name of the "
              "configuration (default auto)")
      ->type_name("NAME");
  AddOverride(command, "--ocio", &o.job.ocio,
              "[maps] OpenColorIO configuration (default: $OCIO, else a built-in one)")
      ->type_name("FILE");
  command->add_flag(
      "--repair-nonfinite", o.job.repair_nonfinite,
      "[maps] Replace NaN and infinite texels by their neighbours instead of refusing the file");
  command->add_flag("--no-toksvig", o.job.no_toksvig,
                    "[maps] Do not raise the roughness of coarser mips by the variance of the "
                    "normals they average");
  command
      ->add_option(
          "--material", o.materials,
          "[scenes] Bake only this material: its name, or # and its index where others have the "
          "same; may be repeated")
      ->type_name("NAME");
  command->add_flag("--learn-all", o.job.learn_all,
                    "[maps] Learn every channel and mip there is, constant and unused ones too");
  std::vector<std::string> effects(EffectNames().begin(), EffectNames().end());
  command
      ->add_option("--effect-off", o.job.effects_off,
                   "[maps] Turn one way of saving work off; may be repeated")
      ->check(CLI::IsMember(effects));
  AddOverride(command, "--constant-tolerance", &o.job.constant_tolerance,
              "[maps] Store a channel as a number if it is that near to it everywhere (default "
              "half an 8-bit code, 0.00196)")
      ->check(FiniteRange(0.0, 1.0))
      ->type_name("X");
  command
      ->add_option_function<std::vector<int>>(
          "--lod-range",
          [&o](const std::vector<int>& mips) {
            o.job.lod_range = {std::min(mips[0], mips[1]), std::max(mips[0], mips[1])};
          },
          "[maps] Bake only the mips from one to the other: what is looked at")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(0, 31))
      ->type_name("MIP,MIP");
  AddCommon(command, line, true);
  command->footer(kBakeFooter);
  command->callback([line] { line->command = Command::kBake; });
}

void AddRun(CLI::App* app, CommandLine* line) {
  CLI::App* command =
      app->add_subcommand("run", "Run one job file, for daemons, scripts and farms");
  command->add_option("JOB", line->run.job_file, "The job file (schemas/job.schema.json)")
      ->required()
      ->type_name("JOB.json");
  command
      ->add_option("--events", line->run.events,
                   "Write progress events to this file, one JSON object a line")
      ->type_name("FILE");
  command
      ->add_option(
          "--result", line->run.result,
          "Where to write the result (default: result.json beside the events, or beside the job)")
      ->type_name("FILE");
  RunGuards& guards = line->run.guards;
  command->add_flag("--skip-unchanged", guards.skip_unchanged,
                    "Bake nothing if the asset's current container is of the same fingerprint");
  command
      ->add_option("--not-revision", guards.not_revision,
                   "With --skip-unchanged: bake all the same if that is this revision")
      ->type_name("REVISION");
  auto* fence = command
                    ->add_option("--fence", guards.fence_file,
                                 "Publish only while this file names the attempt")
                    ->type_name("FILE");
  command->add_option("--attempt", guards.attempt, "Number of the attempt, for --fence")
      ->check(CLI::Range(int64_t{1}, std::numeric_limits<int64_t>::max()))
      ->type_name("N")
      ->needs(fence);
  AddCommon(command, line, true);
  command->footer(
      "The result file is written last and at once, on success and on failure. Example:\n"
      "  patina run job.json --events events.ndjson");
  command->callback([line] { line->command = Command::kRun; });
}

void AddUnpack(CLI::App* app, CommandLine* line) {
  CLI::App* command =
      app->add_subcommand("unpack", "Write the maps of a material's container as images");
  UnpackArguments& o = line->unpack;
  command
      ->add_option("CONTAINER", o.container,
                   "A container, or the folder of an asset (its current container)")
      ->required();
  command->add_option("-o,--out", o.out, "Folder for the images")->required()->type_name("DIR");
  command
      ->add_option("--mip", o.mip,
                   "Mip level, 0 being the size of the source; default: the finest that is stored")
      ->check(CLI::Range(0, 16))
      ->type_name("N");
  command
      ->add_option("--format", o.format,
                   "png (default; 8 or 16 bit as the source) or exr (floats, linear colour); with "
                   "--space the default is what holds the colours")
      ->check(CLI::IsMember({"png", "exr"}));
  CLI::Option* space = command
                           ->add_option("--space", o.space,
                                        "Write colour maps in this colour space (default: sRGB in "
                                        "png, linear Rec.709 in exr)")
                           ->type_name("NAME");
  command
      ->add_option("--ocio", o.ocio,
                   "OpenColorIO configuration that has it (default: $OCIO, else a built-in one)")
      ->type_name("FILE")
      ->needs(space);
  command->add_option("--threads", line->threads, "Threads (default: all CPUs)")
      ->check(CLI::Range(0, kMaxThreads));
  AddCommon(command, line, false);
  command->footer(
      "Files are named by role: albedo, normal (OpenGL), ao, roughness, metalness, displacement, "
      "emissive, opacity ...\n"
      "Example:\n"
      "  patina unpack baked/wall --out maps --format png\n"
      "  patina unpack baked/wall --out maps --space ACEScg");
  command->callback([line] { line->command = Command::kUnpack; });
}

void AddInfo(CLI::App* app, CommandLine* line) {
  CLI::App* command = app->add_subcommand("info", "Say what a container holds and how good it is");
  command
      ->add_option("CONTAINER", line->info.container,
                   "A container, or the folder of an asset (its current container)")
      ->required();
  AddCommon(command, line, true);
  command->footer("Example:\n  patina info baked/wall");
  command->callback([line] { line->command = Command::kInfo; });
}

void AddCompare(CLI::App* app, CommandLine* line) {
  CLI::App* command = app->add_subcommand(
      "compare", "Measure a container against source maps, from the files alone");
  CompareOptions& o = line->compare;
  command
      ->add_option("CONTAINER", o.container,
                   "A container, or the folder of an asset (its current container)")
      ->required();
  command->add_option("SOURCE", o.source, "A folder of maps, or a job file")->required();
  command
      ->add_option("--maps", o.map_list,
                   "List of the maps of SOURCE, in place of finding them by name")
      ->type_name("FILE.json");
  command
      ->add_option("--color-space", o.color_space, "Colour space of the colour maps, as of `bake`")
      ->type_name("NAME");
  command->add_option("--ocio", o.ocio, "OpenColorIO configuration, as of `bake`")
      ->type_name("FILE");
  command->add_flag("--repair-nonfinite", o.repair_nonfinite,
                    "Replace NaN and infinite texels of the source");
  command->add_option("--threads", line->threads, "Threads (default: all CPUs)")
      ->check(CLI::Range(0, kMaxThreads));
  AddCommon(command, line, true);
  command->footer("Example:\n  patina compare baked/wall textures/wall");
  command->callback([line] { line->command = Command::kCompare; });
}

void AddEval(CLI::App* app, CommandLine* line) {
  CLI::App* command =
      app->add_subcommand("eval", "Print values of a baked BRDF at pairs of directions");
  EvalOptions& o = line->eval;
  command
      ->add_option("CONTAINER", o.container,
                   "A container, or the folder of an asset (its current container)")
      ->required();
  command
      ->add_option("--pairs", o.pairs,
                   "Lines of wix,wiy,wiz,wox,woy,woz; of a BRDF that varies over the surface "
                   "followed by ,u,v or ,u,v,level")
      ->required()
      ->type_name("FILE.csv");
  command->add_option("-o,--out", o.out, "Write to this file, not to standard output")
      ->type_name("FILE.csv");
  AddCommon(command, line, false);
  command->footer(
      "Directions are unit vectors, z along the normal, both pointing away from the surface. "
      "Printed is a line r,g,b for\n"
      "each pair: f in 1/sr, linear Rec. 709, without the cosine; 0,0,0 below the horizon. u and v "
      "are texture\n"
      "coordinates, v downwards; level is that of detail, in mips (0, the finest, where the column "
      "is left out).\n"
      "Example:\n"
      "  patina eval baked/chrome --pairs pairs.csv --out values.csv");
  command->callback([line] { line->command = Command::kEval; });
}

void AddSample(CLI::App* app, CommandLine* line) {
  CLI::App* command = app->add_subcommand(
      "sample", "Make sample input: a procedural PBR texture set, and analytic BRDFs as files");
  SampleOptions& o = line->sample;
  command->add_option("-o,--out", o.out, "Folder for the files")->required()->type_name("DIR");
  command
      ->add_option(
          "--kind", o.kind,
          "material: maps and a job.json; brdf: BRDF files of every format, 200 MB; layered: "
          "materials of layers to simulate; svlayers: wood under a scratched lacquer, layers with "
          "maps; scene: a glTF scene and a scene file; btf: a bumpy surface of two materials as a "
          "set of images; all (default): the material, and two small BRDF files in DIR/brdf")
      ->check(CLI::IsMember({"all", "material", "brdf", "layered", "svlayers", "scene", "btf"}));
  command
      ->add_option("--images", o.images,
                   "Images of a BTF, as many lights as views (default 256, at most 22801)")
      ->check(CLI::Range(1, kMaxSampleBtfImages))
      ->type_name("N");
  command
      ->add_option("--size", o.size,
                   "Texels a side of the maps (default 1024, of svlayers 128), of a BTF's images "
                   "(default 64, at most 1024)")
      ->check(CLI::Range(1, kMaxSampleSide))
      ->type_name("N");
  command
      ->add_option("--seed", o.seed,
                   "Another seed makes another floor, and other noise in the measurements "
                   "(default 1)")
      ->check(CLI::Range(uint64_t{0}, kMaxSeed))
      ->type_name("N");
  command->add_option("--threads", line->threads, "Threads (default: all CPUs)")
      ->check(CLI::Range(0, kMaxThreads));
  AddCommon(command, line, false);
  command->footer(
      "Examples:\n"
      "  patina sample --out sample --size 512\n"
      "  patina run sample/job.json\n"
      "  patina sample --kind brdf --out brdfs\n"
      "  patina bake brdfs --out baked\n"
      "  patina sample --kind layered --out layered\n"
      "  patina bake layered/car_paint.layers.json --out baked\n"
      "  patina sample --kind svlayers --out lacquer\n"
      "  patina bake lacquer --out baked\n"
      "  patina sample --kind btf --out bumps --size 128 --images 2500\n"
      "  patina bake bumps --out baked\n"
      "  patina sample --kind scene --out scene\n"
      "  patina bake scene/mosaic.gltf --out baked");
  command->callback([line] { line->command = Command::kSample; });
}

void AddShader(CLI::App* app, CommandLine* line) {
  CLI::App* command = app->add_subcommand(
      "shader", "Write the shader and the tables that decode a container on a GPU");
  ShaderCommandOptions& o = line->shader;
  command
      ->add_option("CONTAINER", o.container,
                   "A container, or the folder of an asset (its current container)")
      ->required();
  command->add_option("-o,--out", o.out, "Folder for the files")->required()->type_name("DIR");
  command
      ->add_option("--lang", o.language,
                   "glsl (default; 450, for OpenGL and Vulkan), essl (OpenGL ES 3.00) or hlsl "
                   "(shader model 5 and newer)")
      ->check(CLI::IsMember({"glsl", "essl", "hlsl"}));
  command
      ->add_option("--first-binding", o.first_binding,
                   "Binding or register of the first texture; the others follow (default 0)")
      ->check(CLI::Range(0, kMaxFirstBinding))
      ->type_name("N");
  AddCommon(command, line, false);
  command->footer(
      "Written are material.glsl or brdf.glsl (.hlsl), one file to include; its weights as the "
      "bytes of a constant\n"
      "buffer; of a BRDF the tables as textures; and bindings.json, which says what to bind where. "
      "A material's features\n"
      "are bound as they lie in the container. formats/ENGINE.md is the guide.\n"
      "Example:\n"
      "  patina shader baked/wall --out shaders/wall --lang hlsl");
  command->callback([line] { line->command = Command::kShader; });
}

CLI::App* AddClient(CLI::App* app, CommandLine* line, Command which, const char* name,
                    const char* description) {
  CLI::App* command =
      app->add_subcommand(name, description)->group("Commands of a daemon's client");
  command
      ->add_option("--socket", line->client.socket,
                   "The daemon's Unix socket (default: $PATINA_SOCKET, else patinad.sock in "
                   "$XDG_STATE_HOME/patina, ~/.local/state/patina or /var/lib/patina)")
      ->type_name("PATH");
  command->add_flag("--json", line->client.json, "Print JSON on standard output");
  command->add_flag("-q,--quiet", line->client.quiet, "No progress, errors only");
  command->callback([line, which] { line->command = which; });
  return command;
}

CLI::Option* AddIds(CLI::App* command, CommandLine* line, int most, const char* help) {
  return command->add_option("ID", line->client.ids, help)
      ->expected(1, most)
      ->check(CLI::Range(int64_t{1}, std::numeric_limits<int64_t>::max()))
      ->type_name("ID");
}

void AddSubmit(CLI::App* app, CommandLine* line) {
  CLI::App* command =
      AddClient(app, line, Command::kSubmit, "submit", "Put jobs into a daemon's queue");
  ClientOptions& o = line->client;
  command->add_option("INPUT", o.inputs, "Job files, folders of maps, BRDF files, folders of both")
      ->required();
  command->add_flag("-w,--wait", o.wait, "Wait for the jobs to end, and show how they go");
  command->add_option("-p,--priority", o.priority, "The higher is run first (default 0)")
      ->check(CLI::Range(-100, 100))
      ->type_name("N");
  command->add_flag("--force", o.force, "Bake even if nothing has changed");
  command
      ->add_option("-o,--out", o.out,
                   "Folder for the containers (default: the job file's, else the daemon's)")
      ->type_name("DIR");
  command
      ->add_option("--key", o.idempotency_key,
                   "A name for this request: sent again, it makes no second job")
      ->type_name("KEY");
  AddAs(command, "; of what lies in a folder that the daemon watches, as it does", &o.as);
  command->add_option("--working-space", o.working_space, "[maps] As of `patina bake`")
      ->check(CLI::IsMember({"lin_rec709", "acescg"}));
  command->add_option("--color-space", o.color_space, "[maps] As of `patina bake`")
      ->type_name("NAME");
  command
      ->add_option("--ocio", o.ocio,
                   "[maps] OpenColorIO configuration, within the daemon's input folders (default: "
                   "the daemon's $OCIO, not yours)")
      ->type_name("FILE");
  command->footer(
      "Prints a line `ID ASSET` for each job. With --wait the exit code is that of the worst job, "
      "as of `patina bake`;\n"
      "an interrupt ends the waiting, not the jobs. What lies in a folder that the daemon watches "
      "has the name that it\n"
      "has there; all else that of `patina bake`.\n"
      "\n"
      "Examples:\n"
      "  patina submit textures/wall --wait\n"
      "  patina submit job.json --priority 10 --json");
}

void AddClientCommands(CLI::App* app, CommandLine* line) {
  ClientOptions& o = line->client;
  constexpr int kMany = 1000;
  AddSubmit(app, line);

  CLI::App* jobs =
      AddClient(app, line, Command::kJobs, "jobs", "List a daemon's jobs, newest first");
  jobs->add_option("--state", o.state,
                   "Only these, separated by commas: queued, running, succeeded, failed, "
                   "cancelled, retry_waiting, buried")
      ->type_name("STATE");
  jobs->add_option("--asset", o.asset, "Only those of one asset")->type_name("NAME");
  jobs->add_option("--limit", o.limit, "At most so many (default 20)")
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  jobs->footer("Example:\n  patina jobs --state running,queued");

  CLI::App* watch = AddClient(app, line, Command::kWatch, "watch",
                              "Show what happens, as it happens, until a job ends or forever");
  AddIds(watch, line, 1, "The job to watch; all if none is named");
  watch->footer(
      "With an ID the exit code is that of the job, as of `patina bake`. --json prints each event "
      "on "
      "a line, and at\n"
      "last the job. Example:\n"
      "  patina watch 12");

  CLI::App* cancel = AddClient(app, line, Command::kCancel, "cancel", "Cancel jobs");
  AddIds(cancel, line, kMany, "The jobs")->required();
  cancel->footer(
      "A running job is asked to end, and ended after a while; `patina watch ID` waits for it.\n"
      "Example:\n  patina cancel 12 13");

  CLI::App* retry = AddClient(app, line, Command::kRetry, "retry",
                              "Queue failed, cancelled or buried jobs again");
  AddIds(retry, line, kMany, "The jobs")->required();
  retry->footer("Example:\n  patina retry 12");

  CLI::App* logs = AddClient(app, line, Command::kLogs, "logs", "Print what a job printed");
  AddIds(logs, line, 1, "The job")->required();
  logs->add_flag("-f,--follow", o.follow, "Go on until the job has ended");
  logs->add_option("--tail", o.tail_bytes, "Only the last so many bytes")
      ->check(CLI::Range(int64_t{1}, std::numeric_limits<int64_t>::max()))
      ->type_name("BYTES");
  logs->footer("Example:\n  patina logs 12 --follow");

  CLI::App* status = AddClient(app, line, Command::kStatus, "status",
                               "Say what a daemon watches, runs and waits for, and what is wrong");
  status->footer("Example:\n  patina status");
}

#include "pipeline/cli/options_pack.inl"
#include "pipeline/cli/options_tradeoff.inl"
#include "pipeline/cli/options_validate.inl"
#include "pipeline/cli/options_view.inl"

}  // namespace

ParsedCommandLine ParseCommandLine(int argc, const char* const* argv) {
  ParsedCommandLine parsed;
  CommandLine line;
  CLI::App app(
      "Patina bakes PBR texture sets and measured BRDFs into small neural materials that any "
      "engine "
      "can sample.",
      "patina");
  app.set_version_flag("--version", std::string("patina ") + PATINA_VERSION, "Print the version");
  app.require_subcommand(1);
  app.footer(kExamples);
  app.get_formatter()->column_width(30);
  AddBake(&app, &line);
  AddRun(&app, &line);
  AddUnpack(&app, &line);
  AddInfo(&app, &line);
  AddCompare(&app, &line);
  AddEval(&app, &line);
  AddSample(&app, &line);
  AddShader(&app, &line);
  AddTradeoff(&app, &line);
  AddPack(&app, &line);
  AddValidate(&app, &line);
  AddView(&app, &line);
  AddClientCommands(&app, &line);
  std::string topic;
  CLI::App* help = app.add_subcommand("help", "Explain a command");
  help->add_option("COMMAND", topic, "The command to explain");

  // Once a command is parsed, CLI11 answers with that command's help.
  const std::string overview = app.help();
  std::vector<std::string> arguments;
  for (int i = argc - 1; i > 0; --i) arguments.emplace_back(argv[i]);
  try {
    if (arguments.empty()) {
      parsed.text = overview;
      return parsed;
    }
    app.parse(arguments);
    if (help->parsed()) {
      parsed.text = topic.empty() ? overview : app.get_subcommand(topic)->help();
      return parsed;
    }
    parsed.command = std::move(line);
  } catch (const CLI::ParseError& error) {
    std::ostringstream out, ignored;
    if (error.get_exit_code() == 0) {
      app.exit(error, out, ignored);
      parsed.text = out.str();
    } else {
      parsed.exit_code = kExitUsage;
      parsed.text = error.what();
      const std::vector<CLI::App*> used = app.get_subcommands();
      parsed.text += used.empty() ? "; see `patina --help`"
                                  : "; see `patina " + used[0]->get_name() + " --help`";
    }
  } catch (const CLI::OptionNotFound&) {
    parsed.exit_code = kExitUsage;
    parsed.text = "there is no command \"" + topic + "\"; `patina help` lists them";
  }
  return parsed;
}

}  // namespace patina
