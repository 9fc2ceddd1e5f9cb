/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine pv: fit a lung's pressure-volume relation to samples, and show one. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "runtime/breath/pv.h"

#include "runtime/options/command.h"

static const char command[] = "pv";

static const char help[] =
    "Usage: supine pv fit SAMPLES.csv [-o FILE] [--confidence SHARE] [--json]\n"
    "       supine pv show [FILE] [--step CMH2O]\n"
    "\n"
    "The lung's pressure-volume relation, measured or built in, as `supine breathe --pv FILE` "
    "uses\n"
    "it.\n"
    "\n"
    "fit   finds the five control parameters of each limb from samples, and says how sure they "
    "are\n"
    "      and how far the curve misses the samples (RMS, in mL and as a percentage of the volume\n"
    "      range; Venegas' and Salazar-Knowles' curves are followed to under 1 %).\n"
    "show  prints volume and compliance against pressure as CSV; without FILE, of the built-in\n"
    "      normal adult lung.\n"
    "\n"
    "SAMPLES.csv has one sample a line, in order of pressure within each limb:\n"
    "\n"
    "      # static manoeuvre; lines like this one are comments\n"
    "      pressure_cmH2O,volume_mL,limb\n"
    "      0,2250,inhale\n"
    "      2.5,2390,inhale\n"
    "      ...\n"
    "      30,5980,exhale\n"
    "\n"
    "Without the column limb all samples are inhale. A limb needs at least 8 samples; where one "
    "limb\n"
    "has none it takes the other's curve. With much noise, 1 % of the volume range say, take 20 "
    "or\n"
    "more. Volumes may be absolute or above any reference: breathing uses differences alone.\n"
    "\n"
    "Options:\n"
    "  -o, --output FILE       write the parameters (CSV, one row a limb)\n"
    "  -c, --confidence SHARE  of the intervals printed, between 0 and 1 (default 0.95)\n"
    "  -j, --json              print the report as JSON\n"
    "  -s, --step CMH2O        pressure step of show (default 1)\n"
    "  -h, --help              print this\n"
    "\n"
    "The model, each limb on its own: V'' = u V' over the pressures of its samples, mapped to x "
    "from\n"
    "-1 to 1, u = c1 P0(x) + ... + c5 P4(x) with Legendre polynomials P0 to P4. V' is the "
    "compliance,\n"
    "u how fast it changes: c1 < 0 stiffens towards high pressure, c2 < 0 puts the greatest\n"
    "compliance in the middle (a sigmoid), c3 skews the sigmoid, c4 and c5 sharpen its knees.\n"
    "\n"
    "Examples:\n"
    "  supine pv fit patient.csv -o patient.pv.csv\n"
    "  supine breathe lungs.safetensors --pv patient.pv.csv -o breath.pvd\n"
    "  supine pv show patient.pv.csv --step 0.5 > curve.csv\n";

static bool parse_positive(const char *text, double *number) {
  return supine_options_parse_number(text, number) && *number > 0.0;
}

typedef struct options {
  const char *output;
  double confidence;
  double step;
  bool json;
} options;

/* What is not finite is null, as JSON has no word for it. */
static void print_json_number(const char *before, double number) {
  (void)fputs(before, stdout);
  if (isfinite(number)) {
    (void)printf("%.17g", number);
  } else {
    (void)fputs("null", stdout);
  }
}

static void print_json_numbers(const char *before, size_t count, const double *numbers) {
  for (size_t i = 0; i < count; ++i) {
    print_json_number(i == 0 ? before : ", ", numbers[i]);
  }
  (void)putchar(']');
}

static void print_json_limb(const supine_pv_curve *curve, const supine_pv_report *report) {
  (void)printf("{\"samples\": %zu", report->samples);
  print_json_numbers(", \"pressure_cmH2O\": [", 2, curve->pressure);
  print_json_numbers(", \"volume_mL\": [", 2, curve->volume);
  print_json_numbers(", \"volume_interval_mL\": [", 2, report->volume_interval);
  print_json_numbers(", \"control\": [", SUPINE_PV_CONTROLS, curve->control);
  print_json_numbers(", \"control_interval\": [", SUPINE_PV_CONTROLS, report->control_interval);
  print_json_number(", \"rms_mL\": ", report->rms);
  print_json_number(", \"rms_percent\": ", report->rms_percent);
  print_json_number(", \"condition\": ", report->condition);
  (void)putchar('}');
}

static void print_json(const supine_pv *pv, const supine_pv_report *reports, double confidence) {
  (void)printf("{\"confidence\": %.17g", confidence);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    if (reports[limb].samples > 0) {
      (void)printf(", \"%s\": ", supine_breath_limb_name((supine_pv_limb)limb));
      print_json_limb(&pv->limb[limb], &reports[limb]);
    }
  }
  (void)printf("}\n");
}

static void print_limb(const char *name, const supine_pv_curve *curve,
                       const supine_pv_report *report) {
  if (report->samples == 0) {
    (void)printf("%s: no samples, the other limb's curve\n", name);
    return;
  }
  (void)printf("%s: %zu samples, %g to %g cmH2O\n", name, report->samples, curve->pressure[0],
               curve->pressure[1]);
  (void)printf("  misfit     %.4g mL RMS, %.3g %% of the volume range\n", report->rms,
               report->rms_percent);
  (void)printf("  condition  %.3g\n", report->condition);
  (void)printf("  V_low      %12.6g +- %.3g mL\n  V_high     %12.6g +- %.3g mL\n", curve->volume[0],
               report->volume_interval[0], curve->volume[1], report->volume_interval[1]);
  for (int i = 0; i < SUPINE_PV_CONTROLS; ++i) {
    (void)printf("  c%d         %12.6g +- %.3g\n", i + 1, curve->control[i],
                 report->control_interval[i]);
  }
}

static int run_fit(const char *path, const options *chosen) {
  supine_error error = {0};
  supine_pv pv = {0};
  supine_pv_report reports[SUPINE_PV_LIMB_COUNT];
  supine_pv_samples samples = {0};
  supine_status status = supine_breath_samples_load(path, &samples, &error);
  if (status == SUPINE_OK) {
    status = supine_breath_fit_samples(&samples, chosen->confidence, &pv, reports, &error);
  }
  supine_breath_samples_clear(&samples);
  if (status == SUPINE_OK && chosen->output != NULL) {
    status = supine_breath_save(chosen->output, &pv, &error);
  }
  if (status != SUPINE_OK) {
    return supine_options_fail(command, &error);
  }
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    if (reports[limb].rms_percent > 1.0) {
      supine_options_say(command, "note: the %s samples scatter %.2g %% about their curve",
                         supine_breath_limb_name((supine_pv_limb)limb), reports[limb].rms_percent);
    }
  }
  if (chosen->json) {
    print_json(&pv, reports, chosen->confidence);
    return supine_options_finish(command);
  }
  (void)printf("intervals at %g %% confidence\n", 100.0 * chosen->confidence);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    print_limb(supine_breath_limb_name((supine_pv_limb)limb), &pv.limb[limb], &reports[limb]);
  }
  return supine_options_finish(command);
}

/* One row of show; nothing where the pressure is outside a limb. */
static supine_status print_row(const supine_pv *pv, double pressure, supine_error *error) {
  (void)printf("%.10g", pressure);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const supine_pv_curve *curve = &pv->limb[limb];
    if (pressure < curve->pressure[0] || pressure > curve->pressure[1]) {
      (void)printf(",,");
      continue;
    }
    double volume = 0.0;
    double compliance = 0.0;
    const supine_status status =
        supine_breath_curve_evaluate(curve, 1, &pressure, &volume, &compliance, error);
    if (status != SUPINE_OK) {
      return status;
    }
    (void)printf(",%.7g,%.7g", volume, compliance);
  }
  (void)putchar('\n');
  return SUPINE_OK;
}

static int run_show(const char *path, const options *chosen) {
  enum { ROWS_MAX = 1000000 };
  supine_error error = {0};
  supine_pv pv = *supine_breath_normal();
  supine_status status = path != NULL ? supine_breath_load(path, &pv, &error) : SUPINE_OK;
  if (status != SUPINE_OK) {
    return supine_options_fail(command, &error);
  }
  const double low = fmin(pv.limb[0].pressure[0], pv.limb[1].pressure[0]);
  const double high = fmax(pv.limb[0].pressure[1], pv.limb[1].pressure[1]);
  const double steps = (high - low) / chosen->step;
  if (!(steps < ROWS_MAX)) {
    return supine_options_usage(command, "--step is too small for this range");
  }
  (void)puts("pressure_cmH2O,inhale_mL,inhale_mL_per_cmH2O,exhale_mL,exhale_mL_per_cmH2O");
  for (size_t j = 0; status == SUPINE_OK && (double)j < steps * (1.0 - 1e-12); ++j) {
    status = print_row(&pv, low + (double)j * chosen->step, &error);
  }
  if (status == SUPINE_OK) {
    status = print_row(&pv, high, &error);
  }
  return status == SUPINE_OK ? supine_options_finish(command)
                             : supine_options_fail(command, &error);
}

int supine_command_pv(int argc, char **argv) {
  static const struct option names[] = {
      {"output", required_argument, NULL, 'o'}, {"confidence", required_argument, NULL, 'c'},
      {"json", no_argument, NULL, 'j'},         {"step", required_argument, NULL, 's'},
      {"help", no_argument, NULL, 'h'},         {NULL, 0, NULL, 0}};
  options chosen = {.output = NULL, .confidence = 0.95, .step = 1.0, .json = false};
  int option = 0;
  optind = 0; /* begin anew, options and words in any order */
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":o:c:js:h", names, NULL)) != -1) {
    switch (option) {
    case 'o':
      chosen.output = optarg;
      break;
    case 'c':
      if (!parse_positive(optarg, &chosen.confidence) || chosen.confidence >= 1.0) {
        return supine_options_usage(
            command, "--confidence wants a number between 0 and 1, not '%s'", optarg);
      }
      break;
    case 'j':
      chosen.json = true;
      break;
    case 's':
      if (!parse_positive(optarg, &chosen.step)) {
        return supine_options_usage(command, "--step wants a positive number of cmH2O, not '%s'",
                                    optarg);
      }
      break;
    case 'h':
      (void)fputs(help, stdout);
      return supine_options_finish(command);
    default:
      return supine_options_bad_option(command, names, option, argv);
    }
  }
  const int words = argc - optind;
  const char *verb = words > 0 ? argv[optind] : "";
  if (strcmp(verb, "fit") == 0) {
    return words == 2 ? run_fit(argv[optind + 1], &chosen)
                      : supine_options_usage(command, "fit wants one file of samples");
  }
  if (strcmp(verb, "show") == 0) {
    return words <= 2 ? run_show(words == 2 ? argv[optind + 1] : NULL, &chosen)
                      : supine_options_usage(command, "show wants at most one file of parameters");
  }
  return words > 0 ? supine_options_usage(command, "fit or show, not '%s'", verb)
                   : supine_options_usage(command, "fit or show what?");
}
