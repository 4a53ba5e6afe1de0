// The parts that pages of both kinds have.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pipeline/jobs/block_sizes.h"
#include "pipeline/jobs/report_page.h"
#include "pipeline/report/html.h"

namespace patina {

// A number that counts, and what it is.
struct HeadFact {
  std::string value;
  std::string name;
};

// Title, kind and verdict: the page up to its first section.
Html BeginReportPage(const PageFacts& facts, const std::string& kind, const std::string& verdict,
                     const std::vector<HeadFact>& head);

void AddWarnings(const PageFacts& facts, Html* html);

// One row of pictures.
void AddTrio(const PageTrio& trio, const std::string& caption, bool texels, Html* html);

// Bytes of the payloads against other ways of storing the same. peers: the largest first or last,
// as they are to stand there.
void AddBytesSection(const PageFacts& facts, const std::vector<TextureBytes>& peers,
                     const std::string& how_counted, Html* html);

// The manifest's effects with their savings. subject: the head of the first column.
void AddEffects(const PageFacts& facts, const char* subject, Html* html);

// Standard error and time against paths, of what is simulated; else nothing.
void AddSimulation(const PageFacts& facts, Html* html);

// Names and values of the training.
void AddTrainingFacts(const std::vector<std::pair<std::string, std::string>>& facts, Html* html);

std::string Spaced(std::string name);                 // "mean_mips" as "mean mips"
std::string StopText(const std::string& stopped_by);  // "it had used up its samples"

// The machine and the end of the page.
std::string FinishReportPage(const PageFacts& facts, Html html);

}  // namespace patina
