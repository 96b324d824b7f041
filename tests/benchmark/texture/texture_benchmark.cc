// texture_benchmark: where roomtex-texture's time goes, and how far that is from the least that
// colouring takes. Runs the command on a capture, or on a room simulated on the spot.

#include <cstdio>
#include <filesystem>
#include <optional>

#include "capture/simulation/capture_writer.h"
#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "importers/scan_reader.h"
#include "tests/benchmark/texture/texture_limit.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "texture/sampling/photo_list.h"

namespace roomtex {
namespace {

struct BenchmarkOptions {
  std::string capture, input_path, image_path, scan_path;
  std::vector<std::string> texture_options;
  ScanReaderOptions scan_reader;
  SimulatedRoomOptions room;
};

// One row of the table: what the command spent, and the least.
void PrintRow(const char* name, double cpu, std::optional<double> least) {
  if (least) {
    std::printf("%-14s %9.3f %9.3f\n", name, cpu, *least);
  } else {
    std::printf("%-14s %9.3f\n", name, cpu);
  }
}

Json RunTexture(const BenchmarkOptions& options, int num_threads, const std::string& folder) {
  std::string line = "roomtex-texture --quiet --input_path '" + options.input_path +
                     "' --image_path '" + options.image_path + "' --scan_path '" +
                     options.scan_path + "' --azimuth " + options.scan_reader.azimuth +
                     " --output_path '" + folder + "' --num_threads " + std::to_string(num_threads);
  for (const std::string& word : options.texture_options) line += " '" + word + "'";
  const CommandResult result = RunCommandLine(line);
  if (result.exit_code != 0 && result.exit_code != kExitUntrusted) {
    throw std::runtime_error("roomtex-texture failed: " + result.err);
  }
  return Json::parse(ReadBytes(folder + "/report.json"));
}

void Print(const Json& texture, const TextureLimit& limit, const Command::Context& context) {
  const Json& cpu = texture["cpu_seconds"];
  double total = 0, coloring = 0, wall = 0;
  for (const auto& [stage, seconds] : cpu.items()) {
    total += seconds.get<double>();
    const bool reads_or_writes = stage == "write" || stage == "other" || stage == "mesh";
    if (!reads_or_writes) coloring += seconds.get<double>();
  }
  for (const auto& [stage, seconds] : texture["seconds"].items()) wall += seconds.get<double>();
  std::printf("stage            CPU [s] least [s]\n");
  for (const auto& [stage, seconds] : cpu.items()) {
    std::optional<double> least;
    if (stage == "decode") least = limit.decode_seconds;
    if (stage == "depth map") least = limit.draw_seconds;
    if (stage == "samples") least = limit.sample_seconds;
    PrintRow(stage.c_str(), seconds.get<double>(), least);
  }
  PrintRow("all", total, limit.Seconds());
  std::printf("\nwall clock                      %10.2f s\n", wall);
  for (const auto& [stage, seconds] : texture["seconds"].items()) {
    std::printf("  %-29s %10.2f s\n", stage.c_str(), seconds.get<double>());
  }
  const double draw = cpu["depth map"], samples = cpu["samples"];
  const double share = limit.Seconds() / coloring, share_of_all = limit.Seconds() / total;
  std::printf("triangles drawn per CPU second  %10.1f million\n",
              1e-6 * static_cast<double>(limit.num_triangles) / draw);
  std::printf("samples looked up per CPU second%10.1f million\n",
              1e-6 * static_cast<double>(limit.num_samples) / samples);
  std::printf("peak memory                     %10.0f MB\n",
              1e-6 * texture["peak_memory_bytes"].get<double>());
  std::printf("CPU per photo, colouring        %10.3f s\n",
              coloring / texture["num_photos"].get<double>());
  std::printf("share of the limit, colouring   %10.1f %%\n", 100 * share);
  std::printf("share of the limit, everything  %10.1f %%\n", 100 * share_of_all);
  Report& report = context.report;
  report["cpu_seconds"] = cpu;
  report["cpu_total"] = total;
  report["cpu_coloring"] = coloring;
  report["limit_seconds"] = {{"decode", limit.decode_seconds},
                             {"depth map", limit.draw_seconds},
                             {"samples", limit.sample_seconds}};
  report["num_triangles"] = limit.num_triangles;
  report["num_samples"] = limit.num_samples;
  report["share_of_limit"] = share;
  report["share_of_limit_all"] = share_of_all;
  report["texture_peak_memory_bytes"] = texture["peak_memory_bytes"];
  report["texture_seconds"] = texture["seconds"];
}

void Benchmark(BenchmarkOptions options, const Command::Context& context) {
  const TempFolder folder;
  if (options.capture.empty()) {
    context.progress.Stage("simulate");
    options.room.random_seed = context.options.random_seed;
    options.capture = folder / "capture";
    Progress quiet(true);
    WriteCapture(SimulatedRoom(options.room), options.capture, &quiet);
  }
  const auto or_else = [](std::string* path, const std::string& other) {
    if (path->empty()) *path = other;
  };
  or_else(&options.input_path, options.capture + "/truth");
  or_else(&options.image_path, options.capture + "/photos");
  or_else(&options.scan_path, options.capture + "/scan.rtpi");
  context.progress.Stage("roomtex-texture");
  const Json texture = RunTexture(options, context.options.num_threads, folder / "textured");
  context.progress.Stage("limit");
  PhotoSources sources;
  sources.image_path = options.image_path;
  const PhotoList list = ListPhotos(ReadSparseModel(options.input_path), sources);
  const Scan scan = ReadScanFile(options.scan_path, options.scan_reader).scans.at(0);
  const TextureLimit limit = MeasureTextureLimit(scan, list.photos);
  context.progress.Finish();
  Print(texture, limit, context);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  BenchmarkOptions o;
  Command command("texture_benchmark",
                  "Where roomtex-texture's time goes, and the least that colouring takes (decode, "
                  "draw, look up, add).",
                  "texture_benchmark --capture_path capture --Texture.scale 1");
  command.AddInputPath(
      "capture_path", &o.capture,
      "folder of roomtex-simulate, true poses are taken; none = a room is simulated",
      Command::Kind::kOptional);
  command.AddInputPath("input_path", &o.input_path, "COLMAP model in the scan frame instead",
                       Command::Kind::kOptional);
  command.AddInputPath("image_path", &o.image_path, "photos instead", Command::Kind::kOptional);
  command.AddInputPath("scan_path", &o.scan_path, "scan instead", Command::Kind::kOptional);
  command.Add(FieldsOf(&o.scan_reader));
  command.AddInt("num_photos", &o.room.num_photos, "simulated photos");
  command.AddInt("photo_width", &o.room.photo_width, "of simulated photos, pixels");
  command.AddInt("photo_height", &o.room.photo_height, "of simulated photos, pixels");
  command.AddInt("scan_columns", &o.room.scan_columns, "of the simulated scan");
  command.AddInt("scan_rows", &o.room.scan_rows, "of the simulated scan");
  for (const char* prefix :
       {"--Texture.", "--Exposure.", "--Blend.", "--Occlusion.", "--Surface."}) {
    command.PassThrough(prefix, &o.texture_options, "options of roomtex-texture");
  }
  return command.Run(argc, argv, [&o](const Command::Context& context) { Benchmark(o, context); });
}
