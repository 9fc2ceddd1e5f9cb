/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A comparison as one HTML file that needs nothing else. */
#include <math.h>
#include <string.h>

#include <supine/version.h>

#include "runtime/options/basis_input.h"
#include "runtime/render/render.h"
#include "runtime/report/comparison_html.h"

static const char style[] =
    ":root{color-scheme:light dark;--ground:#f4f6f8;--card:#fff;--edge:#dbe2e8;--text:#17212d;"
    "--faint:#5d6b79;--grid:#e3e8ed}\n"
    "@media(prefers-color-scheme:dark){:root{--ground:#0f1318;--card:#181e26;--edge:#2a333e;"
    "--text:#eef2f6;--faint:#9aa7b4;--grid:#29323c}}\n"
    "*{box-sizing:border-box}\n"
    "body{margin:0;background:var(--ground);color:var(--text);font:16px/1.5 system-ui,sans-serif}\n"
    "main{max-width:1120px;margin:0 auto;padding:32px 20px 60px}\n"
    "h1{font-size:1.9rem;line-height:1.2;margin:0 0 4px}\n"
    "h2{font-size:1.15rem;margin:0 0 10px}\n"
    "p{margin:6px 0 10px;max-width:75ch}\n"
    ".faint,figcaption,.note{color:var(--faint);font-size:.9rem}\n"
    "section{background:var(--card);border:1px solid var(--edge);border-radius:12px;"
    "padding:18px 20px;margin-top:18px;overflow-x:auto}\n"
    "table{border-collapse:collapse;font-variant-numeric:tabular-nums}\n"
    "th,td{padding:5px 12px;text-align:right;border-bottom:1px solid var(--edge);"
    "white-space:nowrap}\n"
    "th{color:var(--faint);font-weight:600}th:first-child,td.name{text-align:left}\n"
    "tbody tr:last-child td,tbody tr:last-child th{border-bottom:0}\n"
    ".matrix td{border:2px solid var(--card);border-radius:8px;min-width:76px;text-align:center;"
    "padding:10px}\n"
    ".matrix td.self{color:var(--faint)}\n"
    ".row{display:flex;flex-wrap:wrap;gap:18px}.row>*{flex:1 1 330px}\n"
    "figure{margin:0}svg{width:100%;height:auto;display:block}\n"
    "svg text{fill:var(--text);font:12px system-ui,sans-serif}svg "
    ".faint{fill:var(--faint);font-size:12px}\n"
    "svg .grid{stroke:var(--grid)}\n"
    ".pictures{display:grid;gap:6px 14px;align-items:center}\n"
    ".pictures img{width:100%;height:auto;display:block}.pictures b{font-weight:600}\n"
    ".bar{height:12px;border-radius:6px}.ticks{display:flex;justify-content:space-between;"
    "color:var(--faint);font-size:.85rem}\n"
    ".key{display:inline-block;width:12px;height:12px;border-radius:3px;margin-right:6px}\n"
    "@media print{:root{--ground:#fff;--card:#fff;--edge:#ccc;--text:#000;--faint:#444;"
    "--grid:#ddd}section{break-inside:avoid;border-radius:0}"
    "*{-webkit-print-color-adjust:exact;print-color-adjust:exact}main{max-width:none;padding:0}}\n";

void supine_report_html_text(const char *text, FILE *file) {
  for (const char *c = text; *c != '\0'; ++c) {
    switch (*c) {
    case '&':
      (void)fputs("&amp;", file);
      break;
    case '<':
      (void)fputs("&lt;", file);
      break;
    case '>':
      (void)fputs("&gt;", file);
      break;
    case '"':
      (void)fputs("&quot;", file);
      break;
    default:
      (void)fputc(*c, file);
    }
  }
}

void supine_report_html_colour(double t, char hex[8]) {
  double rgb[3];
  supine_render_colour(t, rgb);
  (void)snprintf(hex, 8, "#%02x%02x%02x", (unsigned)(255.0 * rgb[0] + 0.5) & 255U,
                 (unsigned)(255.0 * rgb[1] + 0.5) & 255U, (unsigned)(255.0 * rgb[2] + 0.5) & 255U);
}

/* Told apart by people with any colour vision (M. Okabe and K. Ito, 2008). */
const char *supine_report_html_line(size_t posture) {
  static const char *const lines[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                      "#56b4e9", "#e69f00", "#8c8c8c"};
  return lines[posture % (sizeof lines / sizeof *lines)];
}

static void statistics(const supine_distance_statistics *d, FILE *file) {
  (void)fprintf(file, "<td>%.2f</td><td>%.2f</td><td>%.2f</td><td>%.2f</td>", d->mean, d->rms,
                d->p95, d->max);
}

static void name_cell(const supine_comparison *c, size_t posture, FILE *file) {
  (void)fprintf(file, "<td class=\"name\"><span class=\"key\" style=\"background:%s\"></span>",
                supine_report_html_line(posture));
  supine_report_html_text(c->postures.item[posture].name, file);
  (void)fputs("</td>", file);
}

static void heading(const supine_comparison *c, FILE *file) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  const char *slash = strrchr(c->path, '/');
  char inflation[64];
  supine_report_inflation(c, inflation, sizeof inflation);
  (void)fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
              "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
              "<title>Postures of ",
              file);
  supine_report_html_text(slash != NULL ? slash + 1 : c->path, file);
  (void)fprintf(file, "</title>\n<style>\n%s</style>\n</head>\n<body>\n<main>\n", style);
  (void)fputs("<h1>Lungs under gravity: ", file);
  supine_report_html_text(slash != NULL ? slash + 1 : c->path, file);
  (void)fprintf(file,
                "</h1>\n<p class=\"faint\">%zu posture%s at %s; %zu vertices, %.0f cm&#178; of "
                "surface; supine " SUPINE_VERSION "</p>\n",
                c->postures.count, c->postures.count == 1 ? "" : "s", inflation, info->vertex_count,
                supine_compare_area(c->compare) / 100.0);
}

static void posture_table(const supine_comparison *c, FILE *file) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  (void)fputs("<section>\n<h2>Each posture</h2>\n<table>\n<thead><tr><th>posture</th>"
              "<th>gravity (left, posterior, head)</th><th>mean, mm</th><th>RMS</th><th>95 %</th>"
              "<th>largest</th>",
              file);
  for (size_t lung = 0; info->has_volume && lung < info->lung_count; ++lung) {
    char name[32];
    supine_options_basis_lung_name(c->basis, lung, name, sizeof name);
    (void)fputs("<th>", file);
    supine_report_html_text(name, file);
    (void)fputs(", mL</th>", file);
  }
  (void)fputs("</tr></thead>\n<tbody>\n", file);
  for (size_t i = 0; i < c->postures.count; ++i) {
    const double *g = c->postures.item[i].gravity;
    (void)fputs("<tr>", file);
    name_cell(c, i, file);
    (void)fprintf(file, "<td>%.3g, %.3g, %.3g</td>", g[0] + 0.0, g[1] + 0.0, g[2] + 0.0);
    statistics(&c->posture[i].displacement, file);
    for (size_t lung = 0; info->has_volume && lung < info->lung_count; ++lung) {
      (void)fprintf(file, "<td>%+.1f</td>", c->posture[i].volume[lung]);
    }
    (void)fputs("</tr>\n", file);
  }
  (void)fputs("</tbody>\n</table>\n<p class=\"note\">Displacement from rest, averaged over the "
              "surface's area; 95 % of the area moves no farther than the number in that "
              "column. Volumes are what each lung gains over rest.</p>\n</section>\n",
              file);
}

/* Black or white, whichever reads on a colour of the map. */
static const char *ink(double t) {
  double rgb[3];
  supine_render_colour(t, rgb);
  return 0.3 * rgb[0] + 0.59 * rgb[1] + 0.11 * rgb[2] > 0.5 ? "#101418" : "#fff";
}

static void matrix(const supine_comparison *c, FILE *file) {
  const size_t count = c->postures.count;
  double largest = 0.0;
  for (size_t i = 0; i < count * count; ++i) {
    largest = fmax(largest, c->pair[i].rms);
  }
  (void)fputs("<section>\n<h2>Between postures: RMS distance, mm</h2>\n"
              "<table class=\"matrix\">\n<thead><tr><th></th>",
              file);
  for (size_t i = 0; i < count; ++i) {
    (void)fputs("<th>", file);
    supine_report_html_text(c->postures.item[i].name, file);
    (void)fputs("</th>", file);
  }
  (void)fputs("</tr></thead>\n<tbody>\n", file);
  for (size_t i = 0; i < count; ++i) {
    (void)fputs("<tr><th>", file);
    supine_report_html_text(c->postures.item[i].name, file);
    (void)fputs("</th>", file);
    for (size_t j = 0; j < count; ++j) {
      const double rms = c->pair[i * count + j].rms;
      const double t = largest > 0.0 ? rms / largest : 0.0;
      char hex[8];
      supine_report_html_colour(t, hex);
      if (i == j) {
        (void)fputs("<td class=\"self\">0</td>", file);
      } else {
        (void)fprintf(file, "<td style=\"background:%s;color:%s\">%.2f</td>", hex, ink(t), rms);
      }
    }
    (void)fputs("</tr>\n", file);
  }
  (void)fputs("</tbody>\n</table>\n</section>\n", file);
}

static void pair_table(const supine_comparison *c, FILE *file) {
  const size_t count = c->postures.count;
  (void)fputs("<section>\n<h2>Every pair, mm</h2>\n<table>\n<thead><tr><th>posture</th><th>and</th>"
              "<th>mean</th><th>RMS</th><th>95 %</th><th>largest</th></tr></thead>\n<tbody>\n",
              file);
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) {
      (void)fputs("<tr>", file);
      name_cell(c, i, file);
      name_cell(c, j, file);
      statistics(&c->pair[i * count + j], file);
      (void)fputs("</tr>\n", file);
    }
  }
  (void)fputs("</tbody>\n</table>\n</section>\n", file);
}

static void slab_section(const supine_comparison *c, FILE *file) {
  (void)fputs("<section>\n<h2>Ventilation by height</h2>\n"
              "<p>The lungs at rest, cut into ten slabs of equal thickness across gravity; 0 % is "
              "the lowest point of both lungs. Regional expansion is what the tissue of a slab "
              "gains over its own volume.</p>\n",
              file);
  supine_report_html_profiles(c, file);
  (void)fputs("<table>\n<thead><tr><th>height, %</th>", file);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fputs("<th>", file);
    supine_report_html_text(c->postures.item[i].name, file);
    (void)fputs("</th>", file);
  }
  (void)fputs("</tr></thead>\n<tbody>\n", file);
  for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
    (void)fprintf(file, "<tr><td class=\"name\">%zu to %zu</td>", 100 - 10 * (s + 1), 100 - 10 * s);
    for (size_t i = 0; i < c->postures.count; ++i) {
      (void)fprintf(file, "<td>%+.1f of %.0f mL</td>", c->posture[i].slab[s].gain,
                    c->posture[i].slab[s].volume);
    }
    (void)fputs("</tr>\n", file);
  }
  (void)fputs("</tbody>\n</table>\n</section>\n", file);
}

static void sphere_section(const supine_comparison *c, FILE *file) {
  const supine_extremes *e = &c->extremes;
  (void)fputs("<section>\n<h2>Every direction of gravity</h2>\n", file);
  supine_report_html_map(c, file);
  (void)fprintf(file,
                "<p>The two directions that differ most, of %zu sampled and the best refined, are "
                "(%.3f, %.3f, %.3f) and (%.3f, %.3f, %.3f): %.2f mm RMS. Farthest from supine is "
                "(%.3f, %.3f, %.3f): %.2f mm RMS.</p>\n",
                e->directions, e->pair[0][0], e->pair[0][1], e->pair[0][2], e->pair[1][0],
                e->pair[1][1], e->pair[1][2], e->pair_rms, e->farthest[0], e->farthest[1],
                e->farthest[2], e->farthest_rms);
  (void)fprintf(file,
                "<p>Of the squared displacement over all directions %.2f %% is constant, %.2f %% "
                "is odd (turns over with gravity) and %.2f %% is even beyond the constant: what "
                "makes prone more than the reverse of supine.</p>\n</section>\n",
                100.0 * c->constant, 100.0 * c->odd, 100.0 * c->even);
}

void supine_report_html(const supine_comparison *c, FILE *file) {
  heading(c, file);
  posture_table(c, file);
  (void)fputs("<section>\n<h2>Where each lung moves</h2>\n", file);
  supine_report_html_pictures(c, file);
  (void)fputs("</section>\n", file);
  if (c->postures.count > 1) {
    matrix(c, file);
    pair_table(c, file);
  }
  if (supine_basis_get_info(c->basis)->has_volume) {
    slab_section(c, file);
  }
  sphere_section(c, file);
  (void)fputs("</main>\n</body>\n</html>\n", file);
}
