// SPDX-License-Identifier: MIT
// Colour the surface by `value`. Shading is weak, so that colours match the colour bar.
in vec3 eye;
in vec3 facing;
in vec3 body;
in float value;
uniform sampler2D colours;
uniform vec2 range;    // values at the two ends of the colour bar
uniform float spacing; // difference of the value between contour lines; 0 for no lines
uniform float dark;    // 1 on a dark background
uniform vec4 cut;      // cutting plane: points p in body axes with dot(p, xyz) > w, mm, are not drawn
uniform float opacity;
uniform float ghost;   // 0: surface in colours; 1: translucent shell; 2: only the outline of the shell; 3: the patient's
                       // body, which fades out from range.x to range.y along z; 4: translucent shell of the lungs, lit at the
                       // rim; 5: a structure inside the lungs; 6: translucent shell of anatomy inside the lungs
uniform vec4 rise;     // height of a point p: dot(p, rise.xyz) + rise.w, 0 at the lowest point of the lungs, 1 at the highest
uniform float flatly;  // 1 for colours without shading (the wireframe)
out vec4 colour;

void main() {
  if (dot(body, cut.xyz) > cut.w) discard;
  // If the basis has no normals, use those of the triangles.
  vec3 n = normalize(dot(facing, facing) > 0.0 ? facing : cross(dFdx(eye), dFdy(eye)));
  vec3 view = normalize(-eye);
  n = dot(n, view) < 0.0 ? -n : n;
  float edge = 1.0 - max(dot(n, view), 0.0);
  if (ghost > 3.5 && ghost < 4.5) { // as shade.c draws it; darker towards gravity, where lungs are denser
    vec3 tint = dark > 0.5 ? mix(vec3(0.92, 0.66, 0.62), vec3(1.0, 0.95, 0.93), edge) : mix(vec3(0.78, 0.45, 0.42), vec3(0.36, 0.12, 0.12), edge);
    float amount = 0.10 + 0.75 * pow(edge, 2.2);
    colour = vec4(tint * (0.55 + 0.45 * clamp(dot(body, rise.xyz) + rise.w, 0.0, 1.0)) * amount, amount);
    return;
  }
  if (ghost > 2.5 && ghost < 3.5) {
    float amount = (0.05 + 0.16 * pow(edge, 2.0)) * smoothstep(range.x, range.y, body.z);
    colour = vec4((dark > 0.5 ? vec3(0.68, 0.76, 0.86) : vec3(0.42, 0.49, 0.58)) * amount, amount);
    return;
  }
  if (ghost > 0.5 && ghost < 2.5) {
    float amount = ghost > 1.5 ? 0.6 * smoothstep(0.8, 1.0, edge) : 0.07 + 0.55 * pow(edge, 3.0);
    colour = vec4(vec3(dark > 0.5 ? 0.85 : 0.22) * amount, amount);
    return;
  }
  float at = clamp((value - range.x) / max(range.y - range.x, 1e-6), 0.0, 1.0);
  vec3 base = texture(colours, vec2(at * (255.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb;
  base = lined(base, abs(value), spacing);
  if (flatly > 0.5) {
    colour = vec4(mix(base, base * 0.7, 1.0 - dark), 1.0);
    return;
  }
  if (!gl_FrontFacing && cut.w < 1e9) base = mix(base, vec3(0.55), 0.55); // inner side, visible through the cut: greyish
  vec3 key = normalize(vec3(-0.45, 0.65, 0.75));
  vec3 fill = normalize(vec3(0.8, -0.1, 0.45));
  if (ghost > 5.5) {
    float amount = 0.12 + 0.6 * pow(edge, 2.0);
    colour = vec4(base * amount, amount);
    return;
  }
  if (ghost > 4.5) {
    float shine = 0.25 * pow(max(dot(n, normalize(key + view)), 0.0), 30.0);
    colour = vec4(clamp(base * (0.58 + 0.46 * max(dot(n, key), 0.0)) + shine, 0.0, 1.0), 1.0);
    return;
  }
  // Shade with two lights, and darken the silhouette, to show the shape.
  float diffuse = 0.93 + 0.06 * max(dot(n, key), 0.0) + 0.02 * max(dot(n, fill), 0.0);
  vec3 lit = base * diffuse * (1.0 - 0.5 * pow(edge, 7.0));
  colour = vec4(clamp(lit, 0.0, 1.0) * opacity, opacity);
}
