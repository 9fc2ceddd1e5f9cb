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
                       // body, which fades out from range.x to range.y along z; 4: shell of a translucent lung
uniform float flatly;  // 1 for colours without shading (the wireframe)
out vec4 colour;

void main() {
  if (dot(body, cut.xyz) > cut.w) discard;
  // If the basis has no normals, use those of the triangles.
  vec3 n = normalize(dot(facing, facing) > 0.0 ? facing : cross(dFdx(eye), dFdy(eye)));
  vec3 view = normalize(-eye);
  n = dot(n, view) < 0.0 ? -n : n;
  float edge = 1.0 - max(dot(n, view), 0.0);
  if (ghost > 3.5) {
    vec3 tint = dark > 0.5 ? mix(vec3(0.42, 0.53, 0.68), vec3(0.75, 0.84, 0.97), edge) : mix(vec3(0.55, 0.63, 0.74), vec3(0.20, 0.29, 0.43), edge);
    float amount = 0.15 + 0.5 * edge * edge;
    colour = vec4(tint * amount, amount);
    return;
  }
  if (ghost > 2.5) {
    float amount = (0.05 + 0.16 * pow(edge, 2.0)) * smoothstep(range.x, range.y, body.z);
    colour = vec4((dark > 0.5 ? vec3(0.68, 0.76, 0.86) : vec3(0.42, 0.49, 0.58)) * amount, amount);
    return;
  }
  if (ghost > 0.5) {
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
  // Shade with two lights, and darken the silhouette, to show the shape.
  float diffuse = 0.93 + 0.06 * max(dot(n, key), 0.0) + 0.02 * max(dot(n, fill), 0.0);
  vec3 lit = base * diffuse * (1.0 - 0.5 * pow(edge, 7.0));
  colour = vec4(clamp(lit, 0.0, 1.0) * opacity, opacity);
}
