#version 400 core
// glTF 2.0 metallic-roughness (specification, appendix B) under the Sun and a sky, as linear radiance.
// pyrender sets the uniforms, and replaces names in capitals. Axes are those of the camera, as OpenGL has
// them: x right, y up, z backward.
const float PI = 3.14159265358979;
const float NEAREST_M = 1e-3, FARTHEST_M = 1e6;
const float LAYERS = 7.0, COSINE_LAYER = 5.0, ALBEDO_LAYER = 6.0;  // of the sky
const vec2 TEXEL = 1.0 / vec2(128.0, 64.0);
const float STEEPEST = 20.0;     // largest slope of a face, seen from the Sun, that the shadow map allows for

struct DirectionalLight {
    vec3 color;      // irradiance of a plate that faces the light, W m⁻²
    vec3 direction;  // in which the light travels
    sampler2D shadow_map;
    mat4 light_matrix;
};
struct Material {
    vec4 base_color_factor;
    float metallic_factor, roughness_factor;
    sampler2D base_color_texture, metallic_roughness_texture, normal_texture;
};
uniform DirectionalLight directional_lights[1];
uniform Material material;
uniform float specular, sun_angular_radius_rad;
uniform bool has_sky;
uniform sampler2D sky;  // its layers one below another, as in sky.py

in vec3 frag_position;
in vec3 frag_normal;
in vec2 uv_0;
out vec4 radiance_and_depth;

vec3 mapped_normal(vec3 n) {
#ifdef HAS_NORMAL_TEX
    // The tangents follow from the derivatives of position and texture coordinates.
    vec3 across_x = cross(n, dFdx(frag_position)), across_y = cross(dFdy(frag_position), n);
    vec2 uv_x = dFdx(uv_0), uv_y = dFdy(uv_0);
    float side = sign(dot(dFdx(frag_position), across_y));
    vec3 along_u = (across_y * uv_x.x + across_x * uv_y.x) * side;
    vec3 along_v = (across_y * uv_x.y + across_x * uv_y.y) * side;
    float scale = inversesqrt(max(max(dot(along_u, along_u), dot(along_v, along_v)), 1e-30));
    vec3 t = 2.0 * texture(material.normal_texture, uv_0).xyz - 1.0;
    return normalize(along_u * scale * t.x + along_v * scale * t.y + n * t.z);
#else
    return n;
#endif
}

// Share of the sunlight that no part blocks, on a face with this normal.
float sun_visible(vec3 face_normal, vec3 to_sun) {
    float n_l = dot(face_normal, to_sun);
    if (n_l <= 0.0) return 0.0;
    mat4 map_from_world = directional_lights[0].light_matrix;
    vec2 size = vec2(textureSize(directional_lights[0].shadow_map, 0));
    // A sloping face would shade itself, because the map holds the depth of texels' centres. So the point is
    // moved towards the Sun by what the depth changes over a texel.
    float texel_m = 2.0 / (size.x * length(transpose(map_from_world)[0].xyz));
    float slope = min(sqrt(max(1.0 - n_l * n_l, 0.0)) / n_l, STEEPEST);
    vec3 lifted = frag_position + texel_m * (0.2 + 1.5 * slope) * to_sun;
    vec3 at = (map_from_world * vec4(lifted, 1.0)).xyz * 0.5 + 0.5;
    vec4 lit = step(at.z, textureGather(directional_lights[0].shadow_map, at.xy));
    vec2 part = fract(at.xy * size - 0.5);
    return mix(mix(lit.w, lit.z, part.x), mix(lit.x, lit.y, part.x), part.y);
}

vec3 in_layer(vec2 at, float layer) {
    float row = clamp(at.y, 0.5 * TEXEL.y, 1.0 - 0.5 * TEXEL.y);
    return textureLod(sky, vec2(at.x, (layer + row) / LAYERS), 0.0).rgb;
}

vec3 sky_towards(vec3 d, float layer) {
    return in_layer(vec2(atan(d.x, -d.z) / (2.0 * PI) + 0.5, acos(clamp(d.y, -1.0, 1.0)) / PI), layer);
}

void main() {
    vec3 v = normalize(-frag_position);
    vec3 face_normal = normalize(cross(dFdx(frag_position), dFdy(frag_position)));
    if (dot(face_normal, v) < 0.0) face_normal = -face_normal;
    vec3 n = mapped_normal(normalize(frag_normal));
    if (dot(frag_normal, face_normal) < 0.0) n = -n;  // both sides of a face are visible

    vec3 color = material.base_color_factor.rgb;
    float metal = material.metallic_factor, rough = material.roughness_factor;
#ifdef HAS_BASE_COLOR_TEX
    color *= texture(material.base_color_texture, uv_0).rgb;
#endif
#ifdef HAS_METALLIC_ROUGHNESS_TEX
    vec2 both = texture(material.metallic_roughness_texture, uv_0).rg;
    metal *= both.x;
    rough *= both.y;
#endif
    vec3 f0 = mix(vec3(0.04 * specular), color, metal);
    float f90 = mix(specular, 1.0, metal);
    vec3 diffuse = color * (1.0 - metal);  // of the non-metal's share, below its own coat alone
    float n_v = max(dot(n, v), 1e-4);

    vec3 radiance = vec3(0.0);
    vec3 to_sun = -directional_lights[0].direction;
    float n_l = dot(n, to_sun);
    if (n_l > 0.0) {
        vec3 h = normalize(v + to_sun);
        float n_h = max(dot(n, h), 0.0), v_h = clamp(dot(v, h), 0.0, 1.0);
        // The Sun's disc widens the lobe, so that a mirror shows the right E/(π σ²) at its centre.
        float half_disc = 0.5 * sun_angular_radius_rad;
        float a2 = rough * rough * rough * rough + half_disc * half_disc;
        // 1 − n_h² is computed as |n × h|², because rounding of the difference would spoil a mirror's lobe.
        vec3 off = cross(n, h);
        float d = n_h * n_h * a2 + dot(off, off);
        float distribution = a2 / (PI * d * d);
        float shadowing = 0.5 / (n_l * sqrt(n_v * n_v * (1.0 - a2) + a2)
                               + n_v * sqrt(n_l * n_l * (1.0 - a2) + a2));
        float edge = pow(1.0 - v_h, 5.0);
        vec3 fresnel = f0 + (f90 - f0) * edge;
        float coat = specular * (0.04 + 0.96 * edge);
        vec3 reflected = diffuse / PI * (1.0 - coat) + fresnel * distribution * shadowing;
        radiance += sun_visible(face_normal, to_sun) * directional_lights[0].color * n_l * reflected;
    }
    if (has_sky) {
        vec2 albedo = in_layer(vec2(clamp(n_v, 0.5 * TEXEL.x, 1.0 - 0.5 * TEXEL.x), rough), ALBEDO_LAYER).rg;
        float coat = specular * (0.04 * albedo.x + albedo.y);
        float layer = rough * 4.0;
        vec3 mirrored = reflect(-v, n);
        vec3 lobe = mix(sky_towards(mirrored, floor(layer)), sky_towards(mirrored, ceil(layer)), fract(layer));
        radiance += (f0 * albedo.x + f90 * albedo.y) * lobe
                  + diffuse * (1.0 - coat) * sky_towards(n, COSINE_LAYER);
    }
    float depth_m = -frag_position.z;
    radiance_and_depth = vec4(radiance, depth_m);
    // The logarithm has the same relative precision near and far, so bodies metres and kilometres away go
    // together.
    gl_FragDepth = log(depth_m / NEAREST_M) / log(FARTHEST_M / NEAREST_M);
}
